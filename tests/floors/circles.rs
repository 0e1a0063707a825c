//! What needs itself by way of others.

use std::collections::{BTreeMap, BTreeSet};

/// The strongly connected components of two nodes and more, by a walk there and a walk back.
pub fn circles<T: Copy + Ord>(edges: impl IntoIterator<Item = (T, T)>) -> Vec<BTreeSet<T>> {
    let (mut out, mut back) = (BTreeMap::<T, Vec<T>>::new(), BTreeMap::<T, Vec<T>>::new());
    for (from, to) in edges {
        out.entry(from).or_default().push(to);
        back.entry(to).or_default().push(from);
    }
    let mut met = BTreeSet::<T>::new();
    let mut found = Vec::new();
    for &node in out.keys() {
        if met.contains(&node) {
            continue;
        }
        let there = reached(node, &out);
        let circle: BTreeSet<T> = reached(node, &back).intersection(&there).copied().collect();
        met.extend(&circle);
        if circle.len() > 1 {
            found.push(circle);
        }
    }
    found
}

/// A node and all that can be reached from it.
fn reached<T: Copy + Ord>(node: T, edges: &BTreeMap<T, Vec<T>>) -> BTreeSet<T> {
    let mut seen = BTreeSet::from([node]);
    let mut next = vec![node];
    while let Some(node) = next.pop() {
        let to = edges.get(&node).into_iter().flatten();
        next.extend(to.filter(|&&to| seen.insert(to)));
    }
    seen
}
