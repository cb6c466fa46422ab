//! Parts of an HTML page.

use std::fmt::{Display, Write as _};

use super::pareto::profile;
use crate::report::plot::Scale::{Decades, Share};
use crate::report::plot::{Frame, Look, Series, svg};

pub(super) fn table(html: &mut String, headings: &[String], rows: impl IntoIterator<Item = Vec<String>>) {
    let headings = headings.iter().map(|heading| format!("<th>{heading}</th>")).collect::<String>();
    let _ = writeln!(html, "<div class=\"wide\"><table><tr>{headings}</tr>");
    for cells in rows {
        let _ = writeln!(html, "<tr>{}</tr>", cells.concat());
    }
    html.push_str("</table></div>\n");
}

pub(super) fn cell(class: &str, text: impl Display) -> String {
    if class.is_empty() { format!("<td>{text}</td>") } else { format!("<td class=\"{class}\">{text}</td>") }
}

/// Performance profiles of the solvers `names` over `count` problems.
pub(super) fn profile_picture(
    title: &str,
    y: &str,
    count: usize,
    names: &[(String, Look)],
    costs: &[Vec<Option<f64>>],
) -> String {
    let named = names.iter().zip(profile(costs));
    let series = |((name, look), ratios): (&(String, Look), Vec<f64>)| {
        let share = |n: usize| n as f64 / count as f64;
        let line = ratios.iter().enumerate().map(|(i, &ratio)| (ratio, share(i + 1))).collect();
        Series { name: name.clone(), look: *look, points: Vec::new(), line }
    };
    let frame = Frame { title, x: "time, relative to the fastest", y, scales: (Decades, Share), size: (440, 280) };
    svg(&frame, &named.map(series).collect::<Vec<_>>())
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// An SVG picture for HTML, which needs no name space.
pub(super) fn inline(svg: &str) -> String {
    svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
}
