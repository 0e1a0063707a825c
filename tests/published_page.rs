//! `docs/published.md` is what the source holds of published scores.

use std::path::Path;

use isoflop::scores::published;

#[test]
fn the_page_about_published_scores_is_what_the_source_holds() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/published.md");
    let page = published::page();
    if std::env::var_os("ISOFLOP_BLESS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let again = "ISOFLOP_BLESS=1 cargo test --release --test published_page";
    assert!(page == written, "docs/published.md is not what the source holds; write it: {again}");
}
