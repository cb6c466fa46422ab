//! Suggests the known name that is nearest to an unknown one.

use std::fmt::Display;

/// The name that differs from the typed word by at most one slip in three letters; else the only name that contains the
/// word.
pub fn nearest<'a>(typed: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let typed = typed.trim().to_lowercase();
    let letters = typed.chars().count();
    // For a single letter, all other letters would be equally near.
    if letters < 2 {
        return None;
    }
    let (mut near, mut holding) = (Vec::new(), Vec::new());
    for name in names {
        let slips = strsim::damerau_levenshtein(&typed, &name.to_lowercase());
        if slips <= (letters / 3).max(1) {
            near.push((slips, name));
        }
        if letters > 2 && name.contains(&typed) {
            holding.push(name);
        }
    }
    match (near.into_iter().min_by_key(|n| n.0), &holding[..]) {
        (Some((_, name)), _) => Some(name),
        (None, &[name]) => Some(name),
        _ => None,
    }
}

/// The end of a message: `; did you mean "pile"? more` or `; more`.
pub fn hint<'a>(typed: &str, names: impl IntoIterator<Item = &'a str>, more: impl Display) -> String {
    match nearest(typed, names) {
        Some(name) => format!("; did you mean {name:?}? {more}"),
        None => format!("; {more}"),
    }
}

/// Largest number of names that a message lists in full.
const FEW: usize = 10;

/// Shortens a message of serde about an unknown name. It replaces the long list of all known names by the nearest one
/// and `all`, which says where the list is.
pub fn shorten(message: &str, all: &str) -> String {
    let Some((head, tail)) = message.split_once(", expected one of ") else { return message.to_owned() };
    let Some((list, place)) = tail.rsplit_once('`') else { return message.to_owned() };
    let quoted = |text: &str| text.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    let (typed, known) = (quoted(head).concat(), quoted(list));
    let names = known.iter().map(String::as_str);
    match nearest(&typed, names.clone()) {
        _ if known.len() > FEW => format!("{head}{place}{}", hint(&typed, names, all)),
        Some(name) => format!("{message}; did you mean {name:?}?"),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_in_three_letters_is_forgiven() {
        let names = ["pile", "pyramid", "tower", "stack", "many-pyramids", "run", "render"];
        let of = |typed: &str| nearest(typed, names);
        for (typed, name) in
            [("pyle", "pile"), ("rnu", "run"), ("Pile", "pile"), ("twoer", "tower"), ("pyramd", "pyramid")]
        {
            assert_eq!(of(typed), Some(name), "{typed}");
        }
        assert_eq!(of("many"), Some("many-pyramids"), "the only one that contains it");
        assert!([of("nowhere"), of("p"), of(""), of("abc"), of("r")].iter().all(Option::is_none));
        assert_eq!(nearest("step", ["substeps", "steps_more"]), None, "two contain it");
    }

    #[test]
    fn a_long_list_becomes_the_nearest_name_and_where_the_list_is() {
        let message = "unknown field `substep`, expected one of `substeps`, `b`, `c`, `d`, `e`, `f`, `g`, `h`, `i`, `j`, `k` at line 1 column 5";
        assert_eq!(
            shorten(message, "`drystone settings` lists all"),
            "unknown field `substep` at line 1 column 5; did you mean \"substeps\"? `drystone settings` lists all"
        );
        let far = message.replace("`substep`", "`zzz`");
        assert_eq!(shorten(&far, "see x"), "unknown field `zzz` at line 1 column 5; see x");
        let short = "unknown variant `dics`, expected one of `none`, `box`, `disc`";
        assert_eq!(shorten(short, "see x"), format!("{short}; did you mean \"disc\"?"));
        assert_eq!(shorten("invalid type", "see x"), "invalid type");
    }
}
