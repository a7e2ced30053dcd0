//! Search by words in labels, tags and notes.

use std::str::FromStr;

use super::statement::Statement;

/// The words of a search. Each word must occur in a label, a tag or a note. Upper and lower case are equal.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Words {
    /// One pattern for each word.
    patterns: Vec<String>,
}

impl Words {
    /// Maximum number of words: each of them reads all labels, tags and notes.
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
        Ok(Self { patterns: words.into_iter().map(pattern).collect() })
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
    fn contains(&mut self, column: &str, pattern: &str) -> &mut Self {
        self.push(column).push_either(" GLOB '*' || ", " ~ ").push_bind(pattern);
        self.push_either(" || '*'", "")
    }

    /// Adds the condition that a word is in the label or a tag of the job.
    fn names_job(&mut self, pattern: &str) {
        self.push("job.id IN (SELECT id FROM job").push_either(" INDEXED BY job_label", "");
        self.push(" WHERE label IS NOT NULL AND ").contains("label", pattern);
        self.push(" UNION ALL SELECT job FROM job_tag WHERE ").contains("tag", pattern).push(")");
    }

    /// Adds the condition on a job that each word is in its label, its tags, or the note of its result.
    pub(super) fn job_has_words(&mut self, words: &Words) {
        for pattern in &words.patterns {
            self.push(" AND (").names_job(pattern);
            self.push(" OR job.key IN (SELECT key FROM note WHERE ").contains("text", pattern);
            self.push("))");
        }
    }

    /// Adds the condition on an outline that each word is in the note of the result, or in the label or the tags of a job. With
    /// an owner, only jobs of that owner count.
    pub(super) fn outline_has_words(&mut self, words: &Words, owner: Option<&str>) {
        for pattern in &words.patterns {
            self.push(" AND outline.id IN (SELECT id FROM result_task WHERE key IN (SELECT key FROM note WHERE ");
            self.contains("text", pattern).push(" UNION ALL SELECT key FROM job WHERE ");
            self.names_job(pattern);
            if let Some(owner) = owner {
                self.push(" AND job.owner = ").push_bind(owner);
            }
            self.push("))");
        }
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
