//! Wraps the prose of pages.

/// Longest line of prose (characters).
pub const WIDTH: usize = 120;

/// A text wrapped at [`WIDTH`].
pub fn wrapped(text: &str) -> String {
    let mut words = text.split(' ');
    let (mut lines, mut line) = (String::new(), words.next().unwrap_or_default().to_owned());
    for word in words {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines += &(std::mem::replace(&mut line, word.to_owned()) + "\n");
        } else {
            line += " ";
            line += word;
        }
    }
    lines + &line + "\n"
}

/// Wraps paragraphs. Rows of tables stay whole.
pub fn wrapped_page(text: &str) -> String {
    let line = |line: &str| if line.starts_with('|') { format!("{line}\n") } else { wrapped(line) };
    text.lines().map(line).collect()
}
