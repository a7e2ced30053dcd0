//! What the names of columns say about their numbers.

/// Names of columns that only count the rows.
const INDICES: [&str; 14] = [
    "no", "nr", "n°", "#", "index", "idx", "id", "row", "point", "sample", "specimen", "test",
    "run", "i",
];
/// Functions that a name may begin with.
const FUNCTIONS: [&str; 6] = ["log10", "log2", "log", "ln", "lg", "sqrt"];
/// Names, and beginnings of words in names, of forces across and along the surface.
const NORMAL: [&str; 7] = ["normal", "load", "fn", "fz", "n", "p", "w"];
const TANGENTIAL: [&str; 10] =
    ["tangential", "friction", "lateral", "shear", "reib", "ft", "fx", "ff", "q", "t"];
/// A shorter name is not the beginning of a word.
const SHORTEST: usize = 4;

/// Whether a column only counts the rows.
pub fn is_index(name: &str) -> bool {
    INDICES.contains(&name.to_lowercase().trim_end_matches('.'))
}

/// Whether numbers only count the rows.
pub fn is_count(values: &[Option<f64>]) -> bool {
    let mut steps = values.windows(2).map(|pair| Some(pair[1]? - pair[0]?));
    steps.all(|step| step.is_some_and(|step| step.to_bits() == 1f64.to_bits()))
}

/// The function in a name such as `log10(V)` or `ln V`.
pub fn function(name: &str) -> Option<&'static str> {
    let lower = name.to_lowercase();
    let is_own = |own: &&&str| {
        lower.starts_with(**own) && !name.chars().nth(own.len()).is_some_and(char::is_lowercase)
    };
    FUNCTIONS.iter().find(is_own).copied()
}

/// Whether a column has the changes between readings, as `ΔV` says.
pub fn is_increment(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower.starts_with(['δ', '∆']) || lower.starts_with("delta") || lower.contains("increment")
}

/// Whether a name has one of these words.
fn has(name: &str, words: &[&str]) -> bool {
    let lower = name.to_lowercase();
    let whole: String = lower.chars().filter(|it| it.is_alphabetic()).collect();
    let is_own = |own: &&str| {
        whole == *own
            || own.len() >= SHORTEST && whole.contains(own)
            || lower.split(|it: char| !it.is_alphabetic()).any(|word| word == *own && own.len() > 1)
    };
    words.iter().any(is_own)
}

/// The column of friction forces among columns of forces.
///
/// # Errors
/// Names do not decide.
pub fn friction<'a>(names: &[&'a str]) -> Result<Option<&'a str>, String> {
    let mut found: Vec<&str> =
        names.iter().copied().filter(|name| has(name, &TANGENTIAL)).collect();
    if found.is_empty() {
        found.extend(names.iter().filter(|name| !has(name, &NORMAL)));
    }
    match found[..] {
        [one] => Ok(Some(one)),
        [] if names.is_empty() => Ok(None),
        _ => Err(format!(
            "must be the friction force, but its name does not decide among “{}”. Write the name as this parameter, such as y={}",
            names.join("”, “"),
            names[names.len() - 1]
        )),
    }
}
