//! What a result is looked for by: words and numbers out of its document, in a row of their own.
//!
//! The rows are not written when a result is stored but in quiet moments, and before somebody looks:
//! storing is what many wait for. What is still to come has a larger number than all that is there.

use serde::Deserialize;
use serde_json::{Map, Value, json};
use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

use super::Error;
use super::read::json;
use crate::job::summary;
use fretwork_engine::outcome::UNITS;
use fretwork_engine::request::quantity::Dimension::{
    self, Angle, Force, Length, Number, Stiffness, Stress,
};
use fretwork_engine::request::quantity::Dimension::{Energy, Volume, WearCoefficient};

/// A number that results are looked for by.
#[derive(Debug)]
pub struct Scalar {
    /// What it is called, here and in the tables.
    pub name: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// Whether it is given rather than found, so that it makes scenarios differ.
    pub(super) given: bool,
    /// Where it stands in the document.
    pointer: &'static str,
}

macro_rules! scalars {
    ($($given:literal $name:ident $dimension:ident $pointer:literal;)*) => {
        /// Every such number.
        pub const SCALARS: &[Scalar] = &[$(Scalar {
            name: stringify!($name),
            dimension: $dimension,
            given: $given,
            pointer: $pointer,
        }),*];
    };
}

scalars! {
    true  friction             Number          "/scenario/friction";
    true  normal_modulus       Stress          "/scenario/moduli/normal";
    true  tangential_modulus   Stress          "/scenario/moduli/tangential";
    true  wear_coefficient     WearCoefficient "/scenario/wear/coefficient";
    true  radius               Length          "/scenario/profile/radius";
    true  slope_angle          Angle           "/scenario/profile/slope_angle";
    true  flat_radius          Length          "/scenario/profile/flat_radius";
    true  exponent             Number          "/scenario/profile/exponent";
    true  normal_force         Force           "/scales/normal_force";
    false indentation_depth    Length          "/scales/indentation_depth";
    false contact_radius       Length          "/scales/contact_radius";
    false stick_radius         Length          "/unworn/stick_radius";
    true  amplitude            Length          "/unworn/amplitude";
    false gross_slip_amplitude Length          "/unworn/gross_slip_amplitude";
    false tangential_force     Force           "/unworn/tangential_force";
    true  rig_stiffness        Stiffness       "/scenario/motion/rig_stiffness";
    true  points               Number          "/scenario/model/points";
    true  cycles               Number          "/summary/cycles";
    false wear_volume          Volume          "/summary/wear_volume";
    false wear_depth           Length          "/summary/wear_depth";
    false scar_radius          Length          "/summary/scar_radius";
    false dissipated_energy    Energy          "/summary/dissipated_energy";
}

impl Scalar {
    /// The SI unit; 1 of plain numbers.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        let known = UNITS.iter().find(|(name, _)| *name == self.name).map(|(_, unit)| *unit);
        known.unwrap_or(match self.dimension {
            Number => "1",
            dimension => dimension.si(),
        })
    }
}

/// A word of a closed set that results are looked for by.
#[derive(Debug)]
pub struct Word {
    /// What it is called, here and in the tables.
    pub name: &'static str,
    /// What it can be.
    pub values: &'static [&'static str],
    /// Where it stands in the document.
    pointer: &'static str,
}

/// Every such word.
pub const WORDS: &[Word] = &[
    Word {
        name: "shape",
        values: &[
            "paraboloid",
            "sphere",
            "cone",
            "power",
            "truncated_paraboloid",
            "truncated_cone",
            "table",
        ],
        pointer: "/scenario/profile/shape",
    },
    Word { name: "method", values: &["simplified", "exact"], pointer: "/scenario/model/method" },
    Word {
        name: "regime",
        values: &["full_stick", "partial_slip", "gross_slip"],
        pointer: "/summary/regime",
    },
    Word { name: "held", values: &["depth", "force"], pointer: "/scenario/load/held" },
    Word {
        name: "motion",
        values: &["amplitude", "tangential_force", "rig", "blocks", "reversals"],
        pointer: "/scenario/motion",
    },
];

/// The members of a result document that say what it is about; the others are passed over.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Body {
    pub(super) key: String,
    pub(super) engine: Engine,
    pub(super) scenario: Value,
    scales: Value,
    unworn: Value,
    regime: Value,
    pub(super) history: Map<String, Value>,
}

/// Which engine computed a result.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Engine {
    pub(super) name: String,
    pub(super) numerics: u32,
}

impl Body {
    /// The short form, as it is stored beside the body.
    pub(super) fn summary(&self) -> Value {
        summary(&self.regime, &self.history)
    }

    /// Whether the history has columns of numbers, all of one length.
    pub(super) fn has_history(&self) -> bool {
        let instants = self.history.get("cycles").and_then(Value::as_array).map_or(0, Vec::len);
        let is_column = |column: &Value| {
            column.as_array().is_some_and(|column| {
                column.len() == instants && column.iter().all(Value::is_number)
            })
        };
        instants > 0 && self.history.values().all(is_column)
    }

    /// What the result is looked for by.
    pub(super) fn outline(self) -> Outline {
        let summary = self.summary();
        let Self { scenario, scales, unworn, .. } = self;
        let members = json!({"scenario": scenario, "scales": scales, "unworn": unworn});
        Outline::of(members, summary)
    }
}

/// What a result is looked for by: the words and numbers of [`WORDS`] and [`SCALARS`], in their order.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    pub(super) words: Vec<Option<String>>,
    pub(super) scalars: Vec<Option<f64>>,
}

impl Outline {
    /// The outline of a document, which has `scenario`, and `scales` and `unworn` where they are
    /// known, and its summary.
    #[must_use]
    pub fn of(mut document: Value, summary: Value) -> Self {
        document["summary"] = summary;
        let words = WORDS.iter().map(|word| match document.pointer(word.pointer)? {
            Value::String(text) => Some(text.clone()),
            motion => Some(motion_of(motion)?.to_owned()),
        });
        let number = |scalar: &Scalar| document.pointer(scalar.pointer)?.as_f64();
        Self { words: words.collect(), scalars: SCALARS.iter().map(number).collect() }
    }

    /// Its words by their names.
    pub fn words(&self) -> impl Iterator<Item = (&'static str, Option<&str>)> {
        WORDS.iter().zip(&self.words).map(|(word, value)| (word.name, value.as_deref()))
    }

    /// Its numbers by their names, in SI.
    pub fn scalars(&self) -> impl Iterator<Item = (&'static str, Option<f64>)> {
        SCALARS.iter().zip(&self.scalars).map(|(scalar, value)| (scalar.name, *value))
    }

    async fn store(&self, db: &mut SqliteConnection, place: &Place) -> Result<(), Error> {
        let mut query =
            QueryBuilder::<Sqlite>::new("INSERT INTO outline (id, created, size, present, owner");
        for name in names() {
            query.push(", ").push(name);
        }
        query.push(") VALUES (");
        let mut values = query.separated(", ");
        values.push_bind(place.id).push_bind(place.created).push_bind(place.size);
        values.push_bind(place.present).push_bind(place.owner.clone());
        for word in &self.words {
            values.push_bind(word.clone());
        }
        for number in &self.scalars {
            values.push_bind(*number);
        }
        query.push(")");
        query.build().execute(db).await?;
        Ok(())
    }
}

/// The columns of an outline, in their order.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let words = WORDS.iter().map(|word| word.name);
    words.chain(SCALARS.iter().map(|scalar| scalar.name))
}

/// How the tangential motion is given, in a word.
fn motion_of(motion: &Value) -> Option<&str> {
    let has = |name: &&&str| motion.get(name).is_some();
    let kinds = [("rig_stiffness", "rig"), ("blocks", "blocks"), ("reversals", "reversals")];
    let kind = kinds.iter().find(|(member, _)| has(&member)).map(|(_, word)| *word);
    kind.or_else(|| motion.get("held")?.as_str())
}

/// So many outlines are written at once, or so many bytes read for them: some milliseconds of work.
const AT_ONCE: (u32, i64) = (32, 4 << 20);

/// Writes some of the outlines that are still to come; returns whether there may be more.
pub(super) async fn catch_up(db: &mut SqliteConnection) -> Result<bool, Error> {
    let (mut count, mut bytes) = AT_ONCE;
    while count > 0 && bytes > 0 {
        let Some((place, outline)) = next(db).await? else { return Ok(false) };
        outline.store(db, &place).await?;
        count -= 1;
        bytes -= place.size;
    }
    Ok(true)
}

/// Whether an outline is still to come.
pub(super) async fn is_behind(db: &mut SqliteConnection) -> Result<bool, Error> {
    let behind = "SELECT coalesce((SELECT max(id) FROM result_task), 0)
        > coalesce((SELECT max(id) FROM outline), 0)";
    Ok(sqlx::query_scalar(behind).fetch_one(db).await?)
}

/// What an outline has beside what the document says.
struct Place {
    id: i64,
    created: i64,
    size: i64,
    present: bool,
    owner: Option<String>,
}

async fn next(db: &mut SqliteConnection) -> Result<Option<(Place, Outline)>, Error> {
    let row = sqlx::query(
        "SELECT result_task.id, result.key, task, summary, created, size, owner,
             evicted IS NULL AS present
         FROM result_task CROSS JOIN result USING (key)
         WHERE result_task.id > (SELECT coalesce(max(id), 0) FROM outline)
         ORDER BY result_task.id LIMIT 1",
    )
    .fetch_optional(&mut *db)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let place = Place {
        id: row.try_get("id")?,
        created: row.try_get("created")?,
        size: row.try_get("size")?,
        present: row.try_get("present")?,
        owner: row.try_get("owner")?,
    };
    let key: &[u8] = row.try_get("key")?;
    let body = sqlx::query_scalar("SELECT body FROM result_blob WHERE key = ?1")
        .bind(key)
        .fetch_optional(&mut *db)
        .await
        .map_err(Error::from);
    let body: Option<Vec<u8>> = match body {
        // One that cannot be read keeps no other from being found.
        Err(Error::Damaged(_)) => None,
        read => read?,
    };
    let parsed: Option<Body> = body.and_then(|body| serde_json::from_slice(&body).ok());
    let outline = match parsed {
        Some(body) if body.scenario.is_object() => body.outline(),
        // Dropped before its turn came: what is left of it says less.
        _ => {
            let task: Value = serde_json::from_str(row.try_get("task")?).unwrap_or_default();
            let members = if task.is_object() { task } else { json!({}) };
            Outline::of(members, json(row.try_get("summary")?)?)
        }
    };
    Ok(Some((place, outline)))
}
