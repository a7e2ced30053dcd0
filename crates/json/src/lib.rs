//! JSON with the digits of results, and a parser that reports repeated members.
//!
//! All bodies of requests are read here, so that a refusal lists all faults of the body.

mod members;
mod words;

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};

use deserr::{Deserr, IntoValue, Sequence, Value as Typed};
use fretwork_engine::numeric::Decimal;
use fretwork_engine::{Fault, Faults, Pointer, Valid, twelve_digits};
use serde::Serialize;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::ser::{CompactFormatter, Formatter};
use serde_json::value::RawValue;
use serde_json::{Deserializer, Map, Number, Serializer, Value};

pub use self::members::Members;
pub use self::words::BadWord;

/// Maximum number of repeated members that are listed one by one.
const MAX_LISTED: usize = 100;
/// Maximum total length of the pointers of all listed members, in bytes.
const MAX_POINTERS: usize = 1 << 16;

/// Writes a scenario or a result of about `bytes` bytes, with numbers of 12 significant digits. Infinite numbers are
/// written as null.
///
/// # Panics
/// The document cannot be written as JSON.
#[expect(clippy::expect_used, reason = "a wrong document must not be stored or hashed")]
pub fn write(document: &impl Serialize, bytes: usize) -> String {
    let mut out = Vec::with_capacity(bytes);
    let written = document.serialize(&mut Serializer::with_formatter(&mut out, TwelveDigits));
    written.expect("scenarios and outcomes are numbers, strings, lists and maps of them");
    String::from_utf8(out).expect("JSON is UTF-8")
}

/// Writes numbers with 12 significant digits.
struct TwelveDigits;

impl Formatter for TwelveDigits {
    fn write_f64<W: ?Sized + Write>(&mut self, out: &mut W, number: f64) -> io::Result<()> {
        match Decimal::of(number) {
            Some(decimal) => write_decimal(out, number < 0.0, decimal),
            None if number == 0.0 => out.write_all(b"0.0"),
            None => CompactFormatter.write_f64(out, twelve_digits(number)),
        }
    }
}

/// Writes a decimal number as serde_json writes the nearest float64, without computing this float64.
fn write_decimal<W: ?Sized + Write>(
    out: &mut W,
    is_negative: bool,
    Decimal { digits, places }: Decimal,
) -> io::Result<()> {
    /// The texts of 0…99, in order.
    const PAIRS: [[u8; 2]; 100] = {
        let mut pairs = [[0; 2]; 100];
        let mut n = 0;
        while n < pairs.len() {
            pairs[n] = [b'0' + (n / 10) as u8, b'0' + (n % 10) as u8];
            n += 1;
        }
        pairs
    };
    // All numbers have 12 digits, except 10¹², whose last zero is left out.
    let is_13 = digits == 1_000_000_000_000;
    let digits = if is_13 { digits / 10 } else { digits };
    // The power of ten of the first digit.
    let leading = 11 - i32::from(places) + i32::from(is_13);
    // The text of the number is from `start` to `stop`. Zeros follow its digits. The pairs of two halves do not wait for each other.
    let (mut text, mut start) = ([b'0'; 40], 12);
    for (place, half) in [(start, digits / 1_000_000), (start + 6, digits % 1_000_000)] {
        let half = half as u32;
        text[place..place + 2].copy_from_slice(&PAIRS[(half / 10_000) as usize]);
        text[place + 2..place + 4].copy_from_slice(&PAIRS[(half / 100 % 100) as usize]);
        text[place + 4..place + 6].copy_from_slice(&PAIRS[(half % 100) as usize]);
    }
    let mut end = 24;
    while text[end - 1] == b'0' {
        end -= 1;
    }
    let mut stop = end;
    match leading {
        // The largest number is 10¹². Its point is at index 24.
        0.. => {
            let point = start + leading as usize;
            text.copy_within(start..=point, start - 1);
            text[point] = b'.';
            start -= 1;
            stop = end.max(point + 2);
        }
        -5..0 => {
            start -= (1 - leading) as usize;
            text[start + 1] = b'.';
        }
        _ => {
            if end - start > 1 {
                text[start - 1] = text[start];
                text[start] = b'.';
                start -= 1;
            }
            let [ten, one] = PAIRS[-leading as usize];
            let exponent =
                if ten == b'0' { &[b'e', b'-', one][..] } else { &[b'e', b'-', ten, one] };
            stop += exponent.len();
            text[end..stop].copy_from_slice(exponent);
        }
    }
    if is_negative {
        start -= 1;
        text[start] = b'-';
    }
    out.write_all(&text[start..stop])
}

/// Why a text is not the body of a request.
#[derive(Debug, thiserror::Error)]
pub enum BadBody {
    /// It is not JSON.
    #[error("the text is not JSON")]
    Json(#[source] serde_json::Error),
    /// It is empty.
    #[error("the text is empty")]
    Empty,
    /// It is JSON with these faults.
    #[error("the body has {} fault(s)", .0.len())]
    Faults(Vec<Fault>),
}

/// Parses a body and reads its value. Repeated members and the faults of the value are in one list.
///
/// # Errors
/// The text is not JSON, or it has faults.
pub fn read_body<T>(text: &[u8], read: impl FnOnce(Value) -> Valid<T>) -> Result<T, BadBody> {
    if text.iter().all(u8::is_ascii_whitespace) {
        return Err(BadBody::Empty);
    }
    let (body, mut faults) = parse(text).map_err(|error| BadBody::Json(explained(text, error)))?;
    match read(body) {
        Ok(read) if faults.is_empty() => return Ok(read),
        Ok(_) => {}
        Err(more) => faults.extend(more.0),
    }
    Err(BadBody::Faults(faults))
}

/// Adds to an error what to write instead of the usual mistakes.
fn explained(text: &[u8], error: serde_json::Error) -> serde_json::Error {
    let line = text.split(|byte| *byte == b'\n').nth(error.line().saturating_sub(1));
    let line = line.unwrap_or_default();
    let (before, after) = line.split_at(error.column().saturating_sub(1).min(line.len()));
    let digit = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_digit);
    let mut earlier = before.iter().rev().skip_while(|byte| b", ".contains(byte));
    let start = before.iter().rposition(|byte| !byte.is_ascii_alphabetic()).map_or(0, |at| at + 1);
    let word = line[start..].iter().take_while(|byte| byte.is_ascii_alphabetic());
    let word: Vec<u8> = word.take(9).map(u8::to_ascii_lowercase).collect();
    let advice = match &word[..] {
        b"nan" | b"inf" | b"infinity" => "enter a number instead of NaN or Infinity,",
        _ if error.is_eof() => "the text ends too early: close all brackets and quotation marks",
        b"true" | b"false" | b"none" => "enter true, false or null, in lower case",
        _ if digit(after.first()) && digit(earlier.next()) => {
            "enter numbers with a decimal point and without spaces, such as 0.7 or 10000, and commas between numbers,"
        }
        _ if std::str::from_utf8(text).is_err() => "save the text in UTF-8",
        _ => match std::str::from_utf8(after).unwrap_or_default().chars().next() {
            Some(_) if before.is_empty() && error.line() == 1 => {
                "enter a JSON object, which begins with {"
            }
            Some('.' | '+') => "enter a number that begins with a digit, such as 0.7",
            Some('/' | '#') => "JSON has no comments: remove this one",
            Some('}' | ']') if error.to_string().starts_with("trailing comma") => {
                "remove the comma before this bracket"
            }
            Some('\'' | '‘' | '’' | '“' | '”' | '„' | 'a'..='z' | 'A'..='Z') => {
                "enter names and texts in straight double quotes, such as \"radius\""
            }
            _ => return error,
        },
    };
    // The parser recognises a place at the end of a text, and writes it there again.
    Error::custom(format!("{advice} at line {} column {}", error.line(), error.column()))
}

/// The name of a member as a part of a JSON pointer (RFC 6901).
pub fn escaped(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

/// Reads the members of a document.
///
/// # Errors
/// All faults, with pointers relative to the document.
pub fn typed<T: Deserr<Faults>>(document: Value) -> Valid<T> {
    T::deserialize_from_value(document.into_value(), Pointer::Origin)
}

/// Two values, or the faults of both.
///
/// # Errors
/// One of them has faults.
pub fn both<A, B>(a: Valid<A>, b: Valid<B>) -> Valid<(A, B)> {
    let mut faults = Faults::default();
    let (a, b) = (faults.keep("", a), faults.keep("", b));
    a.zip(b).ok_or(faults)
}

/// Parses JSON, and returns a fault for each member that appears more than once, because dropping one of them silently
/// would lose a parameter. The returned value has the last one.
///
/// # Errors
/// The text is not JSON.
pub fn parse(text: &[u8]) -> Result<(Value, Vec<Fault>), serde_json::Error> {
    let mut repeated = Repeated::default();
    // Some editors write a mark before UTF-8.
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    let mut json = Deserializer::from_slice(text);
    let reader = Reader { location: Pointer::Origin, repeated: &mut repeated };
    let value = reader.deserialize(&mut json)?;
    json.end()?;
    Ok((value, repeated.faults()))
}

/// Repeated members. A short text can contain many of them below a long name, so that their pointers would take much
/// memory. So the list is limited, and the rest is only counted.
#[derive(Default)]
struct Repeated {
    listed: Vec<Fault>,
    /// Bytes of all listed pointers.
    pointers: usize,
    unlisted: usize,
}

impl Repeated {
    fn note(&mut self, location: Pointer<'_>) {
        if self.unlisted == 0 && self.listed.len() < MAX_LISTED {
            let faults = Faults::at(location, "appears more than once; keep one").0;
            let pointers: usize = faults.iter().map(|fault| fault.pointer.len()).sum();
            if self.listed.is_empty() || self.pointers + pointers <= MAX_POINTERS {
                self.pointers += pointers;
                self.listed.extend(faults);
                return;
            }
        }
        self.unlisted += 1;
    }

    fn faults(mut self) -> Vec<Fault> {
        if self.unlisted > 0 {
            let detail = format!(
                "has {} more repeated members, which are not listed. Keep one of each",
                self.unlisted
            );
            self.listed.push(Fault { pointer: String::new(), detail });
        }
        self.listed
    }
}

/// Builds a [`Value`] and records repeated members.
struct Reader<'a> {
    location: Pointer<'a>,
    repeated: &'a mut Repeated,
}

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = Value;

    fn deserialize<D: serde::Deserializer<'de>>(self, json: D) -> Result<Value, D::Error> {
        json.deserialize_any(self)
    }
}

/// The visits of values that become a `Value` as they are.
macro_rules! plain {
    ($($visit:ident($kind:ty))*) => {
        $(fn $visit<E>(self, value: $kind) -> Result<Value, E> { Ok(value.into()) })*
    };
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    plain! { visit_bool(bool) visit_i64(i64) visit_u64(u64) visit_str(&str) }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        let number = Number::from_f64(value);
        number.map(Value::Number).ok_or_else(|| E::custom("number out of range"))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Value, A::Error> {
        let Reader { location, repeated } = self;
        let mut out = Vec::new();
        loop {
            let reader = Reader { location: location.push_index(out.len()), repeated };
            match seq.next_element_seed(reader)? {
                Some(value) => out.push(value),
                None => return Ok(out.into()),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let Reader { location, repeated } = self;
        let mut out = Map::new();
        while let Some(name) = map.next_key::<String>()? {
            let location = location.push_key(&name);
            let value = map.next_value_seed(Reader { location, repeated })?;
            if out.contains_key(&name) {
                repeated.note(location);
            }
            out.insert(name, value);
        }
        Ok(out.into())
    }
}

/// A list of at most `MOST` different items.
#[derive(Debug)]
pub struct Distinct<T, const MOST: usize>(pub Vec<T>);

impl<T: Deserr<Faults> + PartialEq, const MOST: usize> Deserr<Faults> for Distinct<T, MOST> {
    fn deserialize_from_value<V: IntoValue>(value: Typed<V>, location: Pointer<'_>) -> Valid<Self> {
        if let Typed::Sequence(list) = &value
            && list.len() > MOST
        {
            let detail = format!("must list at most {MOST} items, not {}", list.len());
            return Err(Faults::at(location, detail));
        }
        let items = Vec::<T>::deserialize_from_value(value, location)?;
        match (1..items.len()).find(|i| items[..*i].contains(&items[*i])) {
            Some(twice) => Err(Faults::at(location.push_index(twice), "is listed twice")),
            None => Ok(Self(items)),
        }
    }
}

/// A whole number between two bounds.
#[derive(Debug, Clone, Copy)]
pub struct Whole<const LOW: u64, const HIGH: u64>(pub u64);

impl<const LOW: u64, const HIGH: u64> Deserr<Faults> for Whole<LOW, HIGH> {
    fn deserialize_from_value<V: IntoValue>(value: Typed<V>, location: Pointer<'_>) -> Valid<Self> {
        match value {
            Typed::Integer(number) if (LOW..=HIGH).contains(&number) => Ok(Self(number)),
            _ => Err(Faults::at(location, format!("must be a whole number from {LOW} to {HIGH}"))),
        }
    }
}

/// Maximum number of characters of a value in the text of a difference.
const MAX_VALUE: usize = 60;

/// Longest text whose members are compared one by one, in bytes. The parsed members of a hostile text would take many
/// times its memory.
const MAX_COMPARED: usize = 2_000_000;

/// Says where JSON from a file first differs from the JSON that this program computes, such as
/// `history.wear_volume[3]: the file has 1.2e-13, this server computes 1.1e-13`. Members are compared in alphabetical
/// order. The returned place begins with `at`.
pub fn difference(at: &str, file: &str, own: &str) -> String {
    if file.len().max(own.len()) > MAX_COMPARED {
        let same = file.bytes().zip(own.bytes()).take_while(|(file, own)| file == own).count();
        return told(
            at,
            format_args!("the file differs at byte {same} from what this server computes"),
        );
    }
    other_value(at, file, own).unwrap_or_else(|| {
        let same = "the values are the same, but the file writes them in another way, for example with other white space. Import \
                    the file that `fretwork export` wrote, without changing it";
        told(at, format_args!("{same}"))
    })
}

/// Names the first value that differs; `None` if the texts differ only in white space, order or notation.
fn other_value(at: &str, file: &str, own: &str) -> Option<String> {
    if let (Some(theirs), Some(ours)) = (parts(file), parts(own)) {
        let text = |part: Option<&&RawValue>| part.map_or("nothing", |part| part.get()).to_owned();
        return ours.keys().chain(theirs.keys()).find_map(|place| {
            let (file, own) = (text(theirs.get(place)), text(ours.get(place)));
            if file == own { None } else { other_value(&place.below(at), &file, &own) }
        });
    }
    // `0` and `0.0` are the same number, but not the same `Value`.
    let number = |text| serde_json::from_str(text).map(|number: f64| Value::from(number));
    let value = |text| number(text).or_else(|_| serde_json::from_str(text)).ok();
    if value(file).is_some_and(|theirs| value(own) == Some(theirs)) {
        return None;
    }
    let short = |text: &str| text.chars().take(MAX_VALUE).collect::<String>();
    let (file, own) = (short(file), short(own));
    Some(told(at, format_args!("the file has {file}, this server computes {own}")))
}

/// A message about a place. The whole document has no name.
fn told(at: &str, what: fmt::Arguments<'_>) -> String {
    if at.is_empty() { what.to_string() } else { format!("{at}: {what}") }
}

/// The place of a value in a list or in an object.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Entry(usize),
    Member(String),
}

impl Place {
    /// The path to this place in the value at another path.
    fn below(&self, at: &str) -> String {
        match self {
            Self::Entry(index) => format!("{at}[{index}]"),
            Self::Member(name) if at.is_empty() => name.clone(),
            Self::Member(name) => format!("{at}.{name}"),
        }
    }
}

/// The entries of a list or the members of an object; `None` for other JSON.
fn parts(json: &str) -> Option<BTreeMap<Place, &RawValue>> {
    if let Ok(entries) = serde_json::from_str::<Vec<&RawValue>>(json) {
        return Some((0..).map(Place::Entry).zip(entries).collect());
    }
    let members: BTreeMap<String, &RawValue> = serde_json::from_str(json).ok()?;
    Some(members.into_iter().map(|(name, part)| (Place::Member(name), part)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_names_the_place_and_both_values() {
        let own = r#"{"a":{"b":[0.0,1.5]},"c":"x"}"#;
        for (file, said) in [
            (
                r#"{"a":{"b":[0.0,2.5]},"c":"x"}"#,
                "a.b[1]: the file has 2.5, this server computes 1.5",
            ),
            (
                r#"{"a":{"b":[0.0]},"c":"x"}"#,
                "a.b[1]: the file has nothing, this server computes 1.5",
            ),
            (
                r#"{"a":{"b":[0.0,1.5]},"c":"x","d":1}"#,
                "d: the file has 1, this server computes nothing",
            ),
            (
                r#"{"a": {"b":[0.0,1.50]},"c":"y"}"#,
                r#"c: the file has "y", this server computes "x""#,
            ),
            ("5", r#"the file has 5, this server computes {"a":{"b":[0.0,1.5]},"c":"x"}"#),
            (r#"{"a":5,"c":"x"}"#, r#"a: the file has 5, this server computes {"b":[0.0,1.5]}"#),
        ] {
            assert_eq!(difference("", file, own), said);
        }
        for rewritten in
            [r#"{"c":"x","a":{"b":[0.0,1.5]}}"#, r#"{"a": {"b":[0,1.50]}, "c":"\u0078"}"#]
        {
            let said = difference("", rewritten, own);
            assert!(
                said.starts_with("the values are the same, but the file writes them"),
                "{said}"
            );
        }
    }

    #[test]
    fn numbers_are_written_with_twelve_digits() {
        let numbers = [1.0 / 3.0, -2.0e-13 / 3.0, 1e300 / 3.0, 0.1 + 0.2, 5e6, f64::INFINITY];
        let expected = "[0.333333333333,-6.66666666667e-14,3.33333333333e+299,0.3,5000000.0,null]";
        assert_eq!(write(&numbers, 0), expected);
        let numbers = [999_999_999_999.9, -999_999_999_999.9, 1e-5, 9.9e-6, -0.0];
        assert_eq!(write(&numbers, 0), "[1000000000000.0,-1000000000000.0,0.00001,9.9e-6,0.0]");
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            seed >> 11
        };
        for _ in 0..100_000 {
            // All lengths from 1 to 16 digits.
            let digits = random() % 10_u64.pow((random() % 17) as u32) + 1;
            let number: f64 =
                format!("-{digits}e{}", random().cast_signed() % 50 - 36).parse().unwrap();
            let expected = serde_json::to_string(&twelve_digits(number)).unwrap();
            assert_eq!(write(&number, 0), expected, "{number:e}");
        }
    }

    #[test]
    fn repeated_members_are_reported_at_any_depth() {
        let text = br#"{"a": [{"x/y": 1, "x/y": 2}], "b": {}, "a": 1, "a": 2}"#;
        let (value, repeated) = parse(text).unwrap();
        let pointers: Vec<_> = repeated.iter().map(|fault| fault.pointer.as_str()).collect();
        assert_eq!(pointers, ["/a/0/x~1y", "/a", "/a"]);
        assert_eq!(value, serde_json::json!({"a": 2, "b": {}}));
    }

    #[test]
    fn the_list_of_repeated_members_is_bounded() {
        let name = "k".repeat(20_000);
        let many = vec!["\"a\":1"; 10_000].join(",");
        for (text, listed) in
            [(format!("{{{many}}}"), 100), (format!("{{\"{name}\": {{{many}}}}}"), 3)]
        {
            let repeated = parse(text.as_bytes()).unwrap().1;
            assert_eq!(repeated.len(), listed + 1);
            assert!(repeated.iter().map(|fault| fault.pointer.len()).sum::<usize>() <= 1 << 16);
            let last = format!(
                "has {} more repeated members, which are not listed. Keep one of each",
                9_999 - listed
            );
            assert_eq!(repeated[listed].detail, last);
        }
    }

    #[test]
    fn parsing_agrees_with_serde_json() {
        let text =
            br#"{"a": [1, -2, 3.5e-7, null, true, "\u00b5m"], "b": {"c": 18446744073709551615}}"#;
        assert_eq!(parse(text).unwrap().0, serde_json::from_slice::<Value>(text).unwrap());
        for bad in ["", "{", "[1,]", "{} {}", "NaN", "[1e999]", "{'a': 1}"] {
            assert!(parse(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
