//! Search by words in labels, tags and notes.

use std::str::FromStr;

use crate::database::reach::Reach;
use crate::database::statement::Statement;

/// The words of a search. Each word must occur in the label or a tag of a job, or in the note of its result. Upper and lower case
/// are equal.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Words(Vec<String>);

impl Words {
    /// Maximum number of words: each of them is compared with all labels, tags and notes.
    const MOST: usize = 10;
    /// Maximum number of characters of a word.
    const LONGEST: usize = 200;
}

impl FromStr for Words {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let words: Vec<_> = text.split_whitespace().collect();
        if words.len() > Self::MOST || words.iter().any(|word| word.chars().count() > Self::LONGEST)
        {
            return Err(format!(
                "must have at most {} words of at most {} characters",
                Self::MOST,
                Self::LONGEST
            ));
        }
        Ok(Self(words.into_iter().map(str::to_owned).collect()))
    }
}

/// The pattern of a word: a bracket expression for each letter. GLOB in SQLite and regular expressions in PostgreSQL give such
/// expressions the same meaning, in any language. Their functions `lower` differ.
fn pattern(word: &str) -> String {
    let expression = |letter: char| match letter {
        // Without a second character, `[^]` would be a negation. Labels and notes do not contain U+0001.
        '^' => "[\u{1}^]".to_owned(),
        '\\' => r"[\\]".to_owned(),
        letter => {
            let mut cases = vec![letter];
            let upper = single(letter.to_uppercase());
            let lower = upper.and_then(|upper| single(upper.to_lowercase()));
            cases.extend([upper, lower, single(letter.to_lowercase())].into_iter().flatten());
            // The Greek letter and the sign of micrometres look the same, and keyboards have either.
            if cases.contains(&'μ') {
                cases.push('µ');
            }
            cases.sort_unstable();
            cases.dedup();
            format!("[{}]", String::from_iter(cases))
        }
    };
    word.chars().map(expression).collect()
}

/// The only character of a conversion; `None` if it gives several, as for "ß".
fn single(mut letters: impl Iterator<Item = char>) -> Option<char> {
    letters.next().filter(|_| letters.next().is_none())
}

impl Statement {
    /// Adds the condition that a column contains a word.
    fn contains(&mut self, column: &str, word: &str) -> &mut Self {
        self.push(column).push_either(" GLOB '*' || ", " ~ ").push_bind(pattern(word));
        self.push_either(" || '*'", "")
    }

    /// Adds a query for the keys of the notes within reach that contain all words.
    fn keys_of_notes(&mut self, words: &Words, reach: &Reach) -> &mut Self {
        self.push("SELECT key FROM ").notes_within(reach).push(" WHERE TRUE");
        for word in &words.0 {
            self.push(" AND ").contains("text", word);
        }
        self
    }

    /// Adds a query for a column of the jobs within reach with a label or tags that have all words.
    fn named_jobs(&mut self, column: &str, words: &Words, reach: &Reach) -> &mut Self {
        self.push("SELECT ")
            .push(column)
            .push(" FROM job")
            .push_either(" INDEXED BY job_named", "");
        self.push(" WHERE (label IS NOT NULL OR tags <> '[]')").job_within(reach);
        self.name_has_words(words, reach)
    }

    /// Adds the condition on a job that its label, its tags or the note of its result have each word.
    pub(crate) fn name_has_words(&mut self, words: &Words, reach: &Reach) -> &mut Self {
        for word in &words.0 {
            self.push(" AND (").contains("label", word).push(" OR ");
            // The column `tags` is JSON, which has these signs itself.
            if word.contains(['"', '\\', '[', ']', ',']) {
                self.push("id IN (SELECT job FROM job_tag WHERE ").contains("tag", word).push(")");
            } else {
                self.contains("tags", word);
            }
            self.push(" OR key IN (SELECT key FROM ").notes_within(reach).push(" WHERE ");
            self.contains("text", word).push("))");
        }
        self
    }

    /// Adds the condition on a job that it has all words.
    pub(crate) fn job_has_words(&mut self, words: &Words, reach: &Reach) {
        if words.0.is_empty() {
            return;
        }
        self.push(" AND job.id IN (").named_jobs("id", words, reach);
        self.push(" UNION ALL SELECT id FROM job WHERE key IN (").keys_of_notes(words, reach);
        self.push("))");
    }

    /// Adds the condition on an outline that the note of the result, or a job with its label and tags, has all words.
    pub(crate) fn outline_has_words(&mut self, words: &Words, reach: &Reach) {
        if words.0.is_empty() {
            return;
        }
        self.push(" AND outline.id IN (SELECT id FROM result_task WHERE key IN (");
        self.named_jobs("key", words, reach);
        self.push(" UNION ALL ").keys_of_notes(words, reach).push("))");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_has_both_cases_of_each_letter_and_no_other_sign_has_a_meaning() {
        assert_eq!(pattern("Ab1"), "[Aa][Bb][1]");
        assert_eq!(pattern("Öß"), "[Öö][ß]");
        assert_eq!(pattern("μ"), pattern("µ"));
        assert_eq!(pattern("*?]-["), "[*][?][]][-][[]");
        assert_eq!(pattern("^\\"), "[\u{1}^][\\\\]");
    }

    #[test]
    fn too_many_or_too_long_words_are_refused() {
        assert!("a ".repeat(10).parse::<Words>().is_ok());
        assert!("a ".repeat(11).parse::<Words>().is_err());
        assert!("a".repeat(201).parse::<Words>().is_err());
        assert_eq!(" \t".parse(), Ok(Words::default()));
    }
}
