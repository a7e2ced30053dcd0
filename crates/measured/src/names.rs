//! What the names of columns say about their numbers.

/// Names of columns that only count the rows.
const INDICES: &str = "no nr n° # index idx id row point sample specimen test run i";
/// Functions that a name may begin with.
const FUNCTIONS: &str = "log10 log2 log ln lg sqrt";
/// Names, and beginnings of words in names, of forces across and along the surface.
const NORMAL: &str = "normal load fn fz n p w";
const TANGENTIAL: &str = "tangential friction lateral shear reib ft fx ff q t";
/// Names of forces along the surface that name nothing else.
const SHORT: &str = "ft fx ff";
/// A shorter name is not the beginning of a word.
const SHORTEST: usize = 4;

/// Whether a column only counts the rows.
pub fn is_index(name: &str) -> bool {
    let name = name.to_lowercase();
    INDICES.split(' ').any(|own| own == name.trim_end_matches('.'))
}

/// Whether numbers only count the rows.
pub fn is_count(values: &[Option<f64>]) -> bool {
    let mut steps = values.windows(2).map(|pair| Some(pair[1]? - pair[0]?));
    steps.all(|step| step.is_some_and(|step| step.to_bits() == 1f64.to_bits()))
}

/// The words of a name.
fn words(name: &str) -> impl Iterator<Item = &str> {
    name.split(|it: char| !it.is_alphanumeric())
}

/// The function in a name such as `log10(V)`, `ln V` or `V_log`.
pub fn function(name: &str) -> Option<&'static str> {
    let is_own = |word: &str, own: &str| {
        let is_whole = !word.chars().nth(own.len()).is_some_and(char::is_lowercase);
        is_whole && word.to_lowercase().starts_with(own)
    };
    FUNCTIONS.split(' ').find(|own| words(name).any(|word| is_own(word, own)))
}

/// Whether a column has the changes between readings, as `ΔV` and `dV` say.
pub fn is_increment(name: &str) -> bool {
    let lower = name.to_lowercase();
    let is_word = words(name).any(|word| ["dV", "dM", "dW"].contains(&word));
    is_word || ["δ", "∆", "delta", "increment"].iter().any(|own| lower.contains(own))
}

/// Whether a name has one of these words.
fn has(name: &str, list: &str) -> bool {
    let lower = name.to_lowercase();
    let whole: String = lower.chars().filter(|it| it.is_alphabetic()).collect();
    let parts = lower.split(|it: char| !it.is_alphabetic()).filter(|part| part.len() > 1);
    let is_own = |word: &str, own: &str| word == own || own.len() >= SHORTEST && word.contains(own);
    parts.chain([&*whole]).any(|word| list.split(' ').any(|own| is_own(word, own)))
}

/// The column of friction forces among columns of forces. `others` are columns without a known unit.
///
/// # Errors
/// Names do not decide.
pub fn friction<'a>(names: &[&'a str], others: &[&str]) -> Result<Option<&'a str>, String> {
    let mut found: Vec<&str> = names.iter().copied().filter(|name| has(name, TANGENTIAL)).collect();
    let letters = |name: &str| {
        name.chars().filter(|it| it.is_alphabetic()).collect::<String>().to_lowercase()
    };
    let unknown = others.iter().find(|name| SHORT.split(' ').any(|own| own == letters(name)));
    if let Some(name) = unknown.filter(|_| found.is_empty()) {
        return Err(format!(
            "must be the friction force, as the name “{name}” says, but that column has no unit. Write it, such as {name} [N], or \
             choose another column"
        ));
    }
    if found.is_empty() {
        found.extend(names.iter().filter(|name| !has(name, NORMAL)));
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
