//! [`Figure`]: a drawing that may stand within a page.
//!
//! A page runs what an SVG in it says, and anybody may have put a file into a folder. So a drawing is taken only if
//! it is made of the elements and attributes that isoflop's figures are made of.

/// Elements of a figure.
const ELEMENTS: [&str; 5] = ["svg", "polyline", "polygon", "circle", "text"];
/// Their attributes.
const ATTRIBUTES: [&str; 21] = [
    "cx",
    "cy",
    "dy",
    "fill",
    "font-family",
    "font-size",
    "font-weight",
    "height",
    "opacity",
    "points",
    "r",
    "stroke",
    "stroke-linejoin",
    "stroke-width",
    "text-anchor",
    "transform",
    "viewBox",
    "width",
    "x",
    "xmlns",
    "y",
];
/// The only value with other signs than [`is_plain`] ones.
const NAMESPACE: &str = "http://www.w3.org/2000/svg";

/// A figure of the sweep's folder.
pub struct Figure {
    /// That of its file, without the ending.
    pub name: String,
    svg: String,
}

impl Figure {
    /// The figure in the text of an SVG file.
    ///
    /// # Errors
    /// The first thing in it that no figure of isoflop's has, as a clause.
    pub fn read(name: impl Into<String>, file: &str) -> Result<Self, String> {
        let svg = file.trim();
        check(svg)?;
        Ok(Self { name: name.into(), svg: svg.to_string() })
    }

    /// The drawing, from its root on.
    pub fn svg(&self) -> &str {
        &self.svg
    }
}

/// Reads tag after tag: each must be known, and the root must end with the text.
fn check(svg: &str) -> Result<(), String> {
    let (mut rest, mut open, mut seen) = (svg, Vec::new(), 0);
    while let Some((text, after)) = rest.split_once('<') {
        let (tag, after) = after.split_once('>').ok_or("a tag has no end")?;
        if open.is_empty() && (seen > 0 || !text.is_empty()) {
            return Err("there is something beside its `<svg>`".to_string());
        }
        match tag.strip_prefix('/') {
            Some(name) if open.pop() == Some(name) => {}
            Some(name) => return Err(format!("`</{name}>` ends nothing")),
            None => open.extend(opened(tag, seen == 0)?),
        }
        (rest, seen) = (after, seen + 1);
    }
    if seen == 0 || !open.is_empty() || !rest.is_empty() {
        return Err("its `<svg>` does not hold all of it".to_string());
    }
    Ok(())
}

/// The name of an element that begins; `None` if it ends at once.
fn opened(tag: &str, is_root: bool) -> Result<Option<&str>, String> {
    let (tag, is_empty) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
    let (name, mut rest) = tag.split_once(' ').unwrap_or((tag, ""));
    if !ELEMENTS.contains(&name) || (name == "svg") != is_root {
        return Err(format!("it holds `<{name}`"));
    }
    rest = rest.trim();
    while !rest.is_empty() {
        let strange = || format!("it holds `{rest}`");
        let (attribute, after) = rest.split_once("=\"").ok_or_else(strange)?;
        let (value, after) = after.split_once('"').ok_or_else(strange)?;
        let is_known = ATTRIBUTES.contains(&attribute);
        if !is_known || !(is_plain(value) || (attribute, value) == ("xmlns", NAMESPACE)) {
            return Err(format!("it holds `{attribute}=\"{value}\"`"));
        }
        rest = after.trim_start();
    }
    Ok((!is_empty).then_some(name))
}

/// Numbers, colours, names of typefaces and turns; no address and no escape.
fn is_plain(value: &str) -> bool {
    let plain = |sign: char| sign.is_ascii_alphanumeric() || " .,-#()%".contains(sign);
    value.chars().all(plain) && !value.to_ascii_lowercase().contains("url")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOUND: &str = "<svg width=\"9\" xmlns=\"http://www.w3.org/2000/svg\">\n<text x=\"1\">\na &lt;b&gt;\n</text>\n\
                         <polygon fill=\"#FFFFFF\" points=\"0,0 1,1 \"/>\n</svg>\n";

    #[test]
    fn a_planted_svg_is_refused_and_what_it_holds_is_named() {
        assert!(Figure::read("a", SOUND).is_ok());
        for (planted, named) in [
            ("<script>alert(1)</script>", "`<script`"),
            ("<SCRIPT>alert(1)</SCRIPT>", "`<SCRIPT`"),
            ("<circle r=\"1\" onload=\"alert(1)\"/>", "`onload="),
            ("<circle r=\"1\"\nonload=\"alert(1)\"/>", "`onload="),
            ("<circle/onload=alert(1)>", "`<circle/onload=alert(1)`"),
            ("<circle r=1 onload=alert(1)>", "`r=1 onload"),
            ("<foreignObject><img src=\"x\" onerror=\"alert(1)\"/></foreignObject>", "`<foreignO"),
            ("<a href=\"javascript:alert(1)\"><text>x</text></a>", "`<a`"),
            ("<text href=\"javascript:alert(1)\">x</text>", "`href="),
            ("<image href=\"https://example.org/a.png\"/>", "`<image`"),
            ("<use href=\"https://example.org/a.svg#b\"/>", "`<use`"),
            ("<style>@import url(https://example.org/a.css)</style>", "`<style`"),
            ("<circle style=\"background:url(//example.org)\"/>", "`style="),
            ("<circle fill=\"url(#a)\"/>", "`fill="),
            ("<circle fill=\"&#117;rl(#a)\"/>", "`fill="),
            ("<animate attributeName=\"href\" values=\"javascript:alert(1)\"/>", "`<animate`"),
            ("<!-- --><text>x</text>", "`<!--"),
            ("<![CDATA[<script>alert(1)</script>]]>", "`<![CDATA[<script`"),
            ("<svg width=\"1\"></svg>", "`<svg`"),
            ("</svg><script>alert(1)</script><svg>", "beside its `<svg>`"),
            ("</text>", "`</text>` ends nothing"),
            ("<text>", "`</svg>` ends nothing"),
            ("<circle r=\"1", "a tag has no end"),
        ] {
            let file = SOUND.replace("</svg>", &format!("{planted}</svg>"));
            let file =
                if planted.ends_with("=\"1") { SOUND.replace("</svg>\n", planted) } else { file };
            let refused = Figure::read("a", &file).err();
            let refused = refused.unwrap_or_else(|| panic!("{planted} is let in"));
            assert!(refused.contains(named), "{planted}: {refused}");
        }
        for file in ["", "text", "<svg>", "<script/><svg></svg>", "x<svg></svg>", "<svg></svg>x"] {
            assert!(Figure::read("a", file).is_err(), "{file}");
        }
    }

    #[test]
    fn figures_of_committed_studies_are_let_in() {
        let results = concat!(env!("CARGO_MANIFEST_DIR"), "/results");
        let folders = std::fs::read_dir(results).unwrap().flatten();
        let figures = folders.flat_map(|folder| std::fs::read_dir(folder.path().join("figures")));
        let paths = figures.flatten().flatten().map(|figure| figure.path());
        let mut n = 0;
        for path in paths.filter(|path| path.extension().is_some_and(|ending| ending == "svg")) {
            let file = std::fs::read_to_string(&path).unwrap();
            Figure::read("a", &file).map_or_else(|why| panic!("{path:?}: {why}"), drop);
            n += 1;
        }
        assert!(n > 30, "{n}");
    }
}
