use super::*;
use crate::motion::N_JOINTS;

/// Ends a script, then asks for a picture that is not there.
const PLANTED: &str = "</script></title><img src=x onerror=alert(1)>\"'";

#[test]
fn words_of_others_stay_words_wherever_they_stand() {
    let sample = Sample {
        caption: PLANTED.to_string(),
        run_id: PLANTED.to_string(),
        fps: 20.0,
        poses: vec![[[0.0; 3]; N_JOINTS]],
        truth: None,
    };
    let study = Study {
        generator: Some(PLANTED),
        loss_name: Some(PLANTED),
        verdict: PLANTED,
        laws: None,
        predictions: &[],
        records: &[],
        figures: &[Figure::read(PLANTED, "<svg></svg>").unwrap()],
    };
    let told = [PLANTED.to_string()];
    let page = page(&ReportInput {
        name: PLANTED,
        studies: &[study],
        samples: &[sample],
        not_shown: &told,
        tokenizers: &[],
        figures: &[],
        sweep: PLANTED,
        dropped: &told,
    });
    assert!(!page.contains("<img"), "{page}");
    // That of the page, the viewer's and its motions.
    assert_eq!(page.matches("</script>").count(), 3);
    assert!(page.matches("onerror=alert(1)&gt;").count() >= 8, "they are there as words");
}

#[test]
fn motions_that_cannot_be_shown_are_told_without_a_viewer() {
    let input = ReportInput {
        name: "far",
        studies: &[],
        samples: &[],
        not_shown: &["a joint lies 1e38 m away".to_string()],
        tokenizers: &[],
        figures: &[],
        sweep: "",
        dropped: &[],
    };
    let shown = page(&input);
    assert!(shown.contains("<p>a joint lies 1e38 m away</p>") && !shown.contains("<canvas"));
    assert!(!page(&ReportInput { not_shown: &[], ..input }).contains("Samples"));
}
