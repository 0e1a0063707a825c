use super::*;

/// Two slots of a slow machine and of a fast one: small models go slower than large ones.
fn machines() -> [(Speed, usize); 3] {
    let like = |fast: f64| Speed::new(vec![(1e4, 4e9 * fast), (1e6, 2e10 * fast)], 2e10 * fast);
    [(like(1.0), 2), (like(0.7), 2), (like(2.0), 32)]
}

fn offer(machine: &(Speed, usize), hours: f64, unique_tokens: Option<usize>) -> Offer {
    with_terms(machine, hours, unique_tokens, |terms| terms.largest().expect("a sweep"))
}

fn fresh_hours(machine: &(Speed, usize), hours: f64, unique_tokens: Option<usize>) -> Option<f64> {
    with_terms(machine, hours, unique_tokens, |terms| terms.fresh_hours().expect("prices"))
}

fn with_terms<T>(
    (speed, slots): &(Speed, usize),
    hours: f64,
    unique_tokens: Option<usize>,
    then: impl Fn(&Terms) -> T,
) -> T {
    let price = |design: &Design| price(&design::text("a", None, design), speed, *slots);
    then(&Terms { hours, unique_tokens, price: &price })
}

#[test]
fn the_hours_that_are_asked_for_are_spent() {
    for machine in machines() {
        for hours in [0.2, 1.0, 6.0, 24.0, 100.0] {
            let spent = offer(&machine, hours, None).hours / hours;
            assert!((0.7..=1.1).contains(&spent), "{spent:.2} of {hours} h on {machine:?}");
        }
    }
}

#[test]
fn small_data_bind_no_hours_and_the_offer_says_how_many_they_bear() {
    let [machine, ..] = machines();
    for hours in [1.0, 6.0, 100.0] {
        let found = offer(&machine, hours, Some(400_000));
        assert!((0.7..=1.1).contains(&(found.hours / hours)), "{found:?}");
        assert!(found.design.vocab.iter().all(|v| *v <= 20_000));
    }
    let repeated = offer(&machine, 100.0, Some(400_000));
    let fresh = fresh_hours(&machine, 100.0, Some(400_000)).expect("some");
    assert!(fresh < 50.0, "{fresh}");
    // What the hint says holds where it is followed.
    let followed = offer(&machine, fresh, Some(400_000)).design.most_tokens();
    assert!(followed / 400_000.0 <= EPOCHS, "{followed}");
    assert_eq!(fresh_hours(&machine, 100.0, Some(400)), None);
    assert_eq!((repeated.design.seeds.len(), repeated.design.tokenizer_seeds.len()), (3, 3));
}

#[test]
fn models_vocabularies_and_budgets_grow_with_the_hours_and_a_second_seed_measures_noise() {
    let [machine, ..] = machines();
    let designs = [1.0, 6.0, 24.0, 100.0].map(|hours| offer(&machine, hours, None).design);
    let largest = |of: &dyn Fn(&Design) -> f64| designs.each_ref().map(of);
    let last = |values: &[usize]| *values.last().expect("some") as f64;
    let grown = [
        largest(&|design| design.budgets[4]),
        largest(&|design| last(&design.widths)),
        largest(&|design| last(&design.vocab)),
    ];
    for sizes in &grown {
        assert!(sizes.is_sorted() && sizes[0] < sizes[3], "{grown:?}");
    }
    assert!(designs.iter().all(|design| design.seeds == [0, 1]), "{designs:?}");
}
