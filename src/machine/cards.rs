//! [`Card`]: a GPU by name, with the numbers of its data sheet.

/// A GPU.
#[derive(Debug, PartialEq)]
pub struct Card {
    /// The name in a sweep and on the command line.
    pub name: &'static str,
    /// The word by which the driver's name of the device is known: `H100` in `NVIDIA H100 80GB HBM3`.
    pub word: &'static str,
    /// Peak of dense bf16 products that are summed in f32, FLOP/s.
    pub peak_flops: f64,
    /// Memory, bytes.
    pub memory_bytes: f64,
    /// Bandwidth of the memory, bytes/s.
    pub bytes_per_s: f64,
}

impl Card {
    /// Whether a device of this name is such a card; the memory of an A100 is not told apart.
    pub fn is_named(&self, device: &str) -> bool {
        device.split(|c: char| !c.is_ascii_alphanumeric()).any(|word| word == self.word)
    }
}

/// The cards that are known.
///
/// From the vendors' data sheets, without sparsity: NVIDIA A100 (SXM), H100 (SXM), H200 (SXM), L4 and L40S
/// data sheets; the Ada and GA102 whitepapers for the RTX 4090 and 3090; AMD Instinct MI300X data sheet.
pub static CARDS: [Card; 10] = [
    card("a100", "A100", 312e12, 80e9, 2.039e12),
    card("a100-40", "A100", 312e12, 40e9, 1.555e12),
    card("a100-80", "A100", 312e12, 80e9, 2.039e12),
    card("h100", "H100", 989e12, 80e9, 3.35e12),
    card("h200", "H200", 989e12, 141e9, 4.8e12),
    card("l4", "L4", 121e12, 24e9, 0.3e12),
    card("l40s", "L40S", 362e12, 48e9, 0.864e12),
    card("rtx3090", "3090", 71e12, 24e9, 0.936e12),
    card("rtx4090", "4090", 165e12, 24e9, 1.008e12),
    card("mi300x", "MI300X", 1307e12, 192e9, 5.3e12),
];

const fn card(
    name: &'static str,
    word: &'static str,
    peak_flops: f64,
    memory_bytes: f64,
    bytes_per_s: f64,
) -> Card {
    Card { name, word, peak_flops, memory_bytes, bytes_per_s }
}

/// The card of a name; `None` if it is not known.
pub fn find(name: &str) -> Option<&'static Card> {
    CARDS.iter().find(|card| card.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_is_known_by_the_drivers_name() {
        let named = |name: &str, device| find(name).is_some_and(|card| card.is_named(device));
        assert!(named("h100", "NVIDIA H100 80GB HBM3") && named("l4", "NVIDIA L4"));
        assert!(named("a100-40", "NVIDIA A100-SXM4-40GB"));
        assert!(named("rtx4090", "NVIDIA GeForce RTX 4090"));
        assert!(!named("l4", "NVIDIA L40S") && !named("h100", "NVIDIA H200"));
        assert!(!named("h100", "torch cpu") && !named("h100", "custom"));
        assert_eq!(find("h1000"), None);
    }
}
