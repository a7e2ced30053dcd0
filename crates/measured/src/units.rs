//! Units of a table, and names with units.

use fretwork_engine::input::quantity::{Dimension, parse};

/// Texts that stand for the unit of a plain number.
const PLAIN: [&str; 5] = ["", "-", "1", "cycle", "cycles"];
/// Units of masses, with their factors to kg.
pub const MASSES: [(&str, f64); 4] = [("kg", 1.0), ("g", 1e-3), ("mg", 1e-6), ("ug", 1e-9)];
/// The weight of 1 kg in N.
pub const GRAVITY: f64 = 9.806_65;
/// Units that a table may have, although neither a scenario nor a measured output has them.
const FOREIGN: [&str; 7] = ["s", "ms", "min", "h", "Hz", "%", "°C"];
/// Units that only tables have. Behind each is what it is.
const OTHERS: &str = "Å 0.1nm pm 0.001nm gf 0.00980665N kgf 9.80665N kp 9.80665N";
/// Words for units, without the s of a plural, and for their prefixes. Behind each is its symbol.
const WORDS: &str = "micron um angstrom Å meter m metre m newton N pascal Pa joule J gram g gramforce gf kilogramforce kgf \
                     inch in inche in degree deg radian rad sec s second s minute min hour h percent %";
const PREFIXES: &str = "nano n micro u milli m centi c kilo k mega M giga G";
/// The word before a unit, as in `Load in N`. It is no inch.
const IN: &str = "in ";
/// Words for a factor in the name of a column.
const MANY: &str = "thousand thousands million millions mio tsd";
/// Texts for many cycles. The first of each stands alone, too.
const COUNTS: [(&str, f64); 2] =
    [("thousand k kilo 10^3 10³ 1e3 1000", 1e3), ("million m mega 10^6 10⁶ 1e6 1000000", 1e6)];
/// Powers of length and force of the dimensions that a product of units can have.
const PRODUCTS: [(Dimension, [i32; 2]); 7] = [
    (Dimension::Length, [1, 0]),
    (Dimension::Force, [0, 1]),
    (Dimension::Stress, [-2, 1]),
    (Dimension::Energy, [1, 1]),
    (Dimension::Volume, [3, 0]),
    (Dimension::Stiffness, [-1, 1]),
    (Dimension::WearCoefficient, [2, -1]),
];

/// A known unit: its dimension, `None` if no quantity of a scenario has it, the unit in SI, and the factor to that.
pub type Unit = (Option<Dimension>, String, f64);

/// The words of a list, each with the text behind it.
fn pairs(list: &'static str) -> impl Iterator<Item = (&'static str, &'static str)> {
    let mut texts = list.split(' ');
    std::iter::from_fn(move || Some((texts.next()?, texts.next()?)))
}

/// The text behind a word in a list of pairs.
fn behind(list: &'static str, word: &str) -> Option<&'static str> {
    pairs(list).find(|it| it.0 == word).map(|it| it.1)
}

/// The symbol of a unit that is written as a word, such as `um` for `Microns` or `micrometer`.
fn symbol(text: &str) -> String {
    let word = Some(text.trim_matches([' ', '(', ')', '[', ']', '.']));
    let word = word.filter(|word| !word.is_empty()).unwrap_or(text);
    if let Some(length) = ["cubic ", "cu. ", "cu "].iter().find_map(|own| word.strip_prefix(own)) {
        return format!("{}^3", symbol(length));
    }
    let lower = word.to_lowercase().replace(['-', ' '], "");
    let of = |word: &str| behind(WORDS, word.trim_end_matches('s'));
    let prefixed = |(long, own)| Some(format!("{own}{}", of(lower.strip_prefix(long)?)?));
    let known = of(&lower).map(str::to_owned).or_else(|| pairs(PREFIXES).find_map(prefixed));
    known.unwrap_or_else(|| word.to_owned())
}

/// How many cycles a unit such as `kcycles`, `cycles_k`, `10^3 cycles` or `thousands` is.
fn counts(text: &str) -> Option<f64> {
    let lower = text.to_lowercase().replace("cycles", "cycle").replace("zyklen", "cycle");
    let before = lower.strip_suffix("cycle").or_else(|| lower.strip_prefix("cycle_"));
    let word = before.unwrap_or(&lower).trim().trim_end_matches(" of").trim_end_matches('s');
    let is_word = |list: &str| {
        list.split(' ').take(if before.is_some() { 7 } else { 1 }).any(|it| it == word)
    };
    COUNTS.into_iter().find(|it| is_word(it.0)).map(|it| it.1)
}

/// Reads the unit of a header or of a cell.
pub fn unit(text: &str) -> Option<Unit> {
    let text = &*symbol(text.strip_prefix(IN).unwrap_or(text));
    let plain = text.replace(['µ', 'μ'], "u");
    let mass = MASSES.iter().find(|it| it.0 == plain).map(|it| (None, "kg", it.1));
    let of = |it: Dimension| Some((Some(it), it.si(), parse(&format!("1 {text}"), it).ok()?));
    let known = match text {
        _ if PLAIN.contains(&text) => Some((Some(Dimension::Number), "1", 1.0)),
        _ if FOREIGN.contains(&text) => Some((None, text, 1.0)),
        _ => mass.or_else(|| Dimension::all().find_map(of)),
    };
    known
        .or_else(|| Some((Some(Dimension::Number), "1", counts(text)?)))
        .or_else(|| product(text))
        .map(|(dimension, si, factor)| (dimension, si.to_owned(), factor))
}

/// An exponent such as `^-6` or `⁻⁶`.
pub fn exponent(text: &str) -> Option<i32> {
    let plain = text.chars().filter(|it| !"^{}".contains(*it)).map(|it| {
        let place = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻−".chars().position(|own| own == it);
        place.map_or(it, |place| char::from(b"0123456789--"[place]))
    });
    let plain: String = plain.collect();
    plain.parse().ok().filter(|exponent: &i32| exponent.abs() < 400)
}

/// The powers of length and force of a unit, and its factor to SI.
fn factors(name: &str) -> Option<([i32; 2], f64)> {
    let text = behind(OTHERS, name).map_or_else(|| format!("1 {name}"), str::to_owned);
    PRODUCTS[..5].iter().find_map(|it| Some((it.1, parse(&text, it.0).ok()?)))
}

/// A product of units, such as `mm3/N/m` or `mm^3 N^-1 m^-1`.
fn product(text: &str) -> Option<(Option<Dimension>, &'static str, f64)> {
    let (mut powers, mut factor) = ([0, 0], 1.0);
    for (place, part) in text.split('/').enumerate() {
        let terms = part.split([' ', '·', '⋅', '*', '(', ')']);
        for term in terms.filter(|term| !["", "1"].contains(term)) {
            let end = term.find(|it: char| !it.is_alphabetic() && it != '°').unwrap_or(term.len());
            // A number alone, as in `V 3`, is no unit.
            let (own, of_one) = (end > 0).then(|| factors(&symbol(&term[..end])))??;
            let power = if end < term.len() { exponent(&term[end..])? } else { 1 };
            let power = if place > 0 { -power } else { power };
            let of_all = (0..power.abs().min(9)).fold(1.0, |all, _| all * of_one);
            factor *= if power < 0 { 1.0 / of_all } else { of_all };
            (0..2).for_each(|at| powers[at] += power * own[at]);
        }
    }
    let (dimension, _) = PRODUCTS.iter().find(|(_, own)| *own == powers)?;
    let is_energy = *dimension == Dimension::WearCoefficient && text.contains('J');
    let dimension = if is_energy { Dimension::EnergyWear } else { *dimension };
    Some((Some(dimension), dimension.si(), factor))
}

/// Where a factor at the end of a name begins, such as `1e-3` in `V in 1e-3 mm^3`. The 2 in `Sensor 2 (um)` is none.
fn factor(name: &str, is_bracketed: bool) -> Option<usize> {
    let name = name.trim_end();
    let word = name.rsplit([' ', '/', '(', ',', '*', '×']).next().unwrap_or("");
    let at = name.len() - word.len();
    let is_raised = word.contains(|it: char| it == '^' || !it.is_ascii());
    let sign = if at > 0 || is_raised { 'x' } else { ' ' };
    let plain = word.trim_start_matches(sign).trim_end_matches(')');
    let is_power = plain.starts_with("10") && !plain.contains(char::is_alphabetic);
    let is_number = is_power || plain.parse::<f64>().is_ok_and(f64::is_finite);
    let is_label = is_bracketed
        && plain.bytes().all(|byte| byte.is_ascii_digit())
        && (word == plain || plain.len() == 1)
        && !name[..at].trim_end().ends_with(['×', '*', '/']);
    (is_number && !is_label).then_some(at)
}

/// Whether a name has a factor, as in `V·10³`, `V x 1000`, `1000*V`, `N in 1000`, `V E+3` and `V, Mio.`. It can belong to the quantity
/// or to the unit.
pub fn has_factor(name: &str) -> bool {
    let name = name.replace(['·', '⋅', '*'], "×").replace('×', " × ");
    let words = name.split([' ', ',', '(', ')', '/', '_']).map(|word| word.trim_end_matches('.'));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let is_power = |word: &str| {
        word.strip_prefix("10").is_some_and(|rest| rest.is_empty() || exponent(rest).is_some())
    };
    // `x` is also the name of a position.
    let is_product = |(at, pair): (usize, &[&str])| match pair {
        ["×", after] => is_power(after),
        ["x", after] => at > 0 && is_power(after),
        ["in", after] => after.len() > 3 && is_power(after),
        [before, "V"] => before.len() > 3 && is_power(before),
        [before, after] => *after == "×" && is_power(before),
        _ => false,
    };
    let is_word = |word: &str| {
        let is_raised = word
            .strip_prefix(['E', 'e'])
            .is_some_and(|rest| rest.starts_with('+') && rest.parse::<u32>().is_ok());
        is_raised || MANY.split(' ').any(|own| own == word.to_lowercase())
    };
    // As in `Vx1000`. `dx1000` is the name of a position.
    let is_joined = |word: &str| {
        let parts = word.split_once('x').filter(|it| it.0.len() == 1 && it.1.len() > 3);
        parts.is_some_and(|(before, after)| {
            before.bytes().all(|it| it.is_ascii_uppercase()) && is_power(after)
        })
    };
    words.windows(2).enumerate().any(is_product)
        || words.iter().any(|word| is_word(word) || is_joined(word))
}

/// Splits a header such as `Depth [µm]`, `Force/N`, `dx_um` or `wear_volume mm^3` into name and unit. A factor belongs to the
/// unit, which is then unknown, as other words in brackets at the end are.
pub fn header(text: &str) -> (&str, Option<&str>) {
    if counts(text).is_some() {
        return ("cycles", Some(text));
    }
    let is_split = |(at, mark): &(usize, char)| {
        let rest = text[at + mark.len_utf8()..].trim();
        let rest = rest.strip_suffix(')').filter(|_| *mark == '(').unwrap_or(rest);
        let is_bracketed = *mark == '(' || rest.starts_with('(');
        let is_inside = text[..*at].matches('(').count() > text[..*at].matches(')').count();
        let is_unit = is_bracketed || !PLAIN.contains(&rest);
        " /(,_".contains(*mark) && !is_inside && is_unit && unit(rest).is_some()
    };
    let known = || Some(text.char_indices().skip(1).find(is_split)?.0);
    let bracket = || text.ends_with(')').then(|| text.rfind('('))?.filter(|at| *at > 0);
    let at = text.find('[').or_else(known).or_else(bracket);
    let is_bracketed =
        at.is_none_or(|at| text[at..].trim_start_matches('_').trim_start().starts_with(['[', '(']));
    let at = factor(&text[..at.unwrap_or(text.len())], is_bracketed).or(at);
    let (name, unit) = text.split_at(at.unwrap_or(text.len()));
    let marks = [' ', '/', ',', '(', ':', '×', '*', '_'];
    let unit = unit.trim_matches(['[', ']', ' ', '/', ',', '_']);
    let inner = unit.strip_prefix('(').and_then(|own| own.strip_suffix(')')).unwrap_or(unit);
    (name.trim_matches(marks), at.map(|_| inner.strip_prefix(IN).unwrap_or(inner)))
}
