//! The JSON Schema of a scenario agrees with the parser.

use fretwork_engine::request::changing::MAX_CHANGES;
use fretwork_engine::request::fields::{
    BlockCycles, BlockForce, DissipatedEnergy, EnergyWear, Exponent, Force, Friction, Height,
    Instant, LAST_CYCLE, Length, MAX_CYCLES, POINTS_RANGE, PoissonRatio, Position, Share,
    SlopeAngle, StickRatio, Stiffness, Stress, Stroke, Tolerance, Volume, WEAR_RANGE, Xi,
};
use fretwork_engine::request::held::{MAX_BLOCKS, MAX_REVERSALS};
use fretwork_engine::request::indenter::MAX_ROWS;
use fretwork_engine::request::quantity::Dimension;
use fretwork_engine::request::wear::MAX_LAYERS;
use fretwork_engine::scenario::{self, DEFAULT_POINTS, DEFAULT_TOLERANCE, SCHEMA};
use serde_json::{Value, json};

fn schema() -> Value {
    serde_json::from_str(SCHEMA).expect("the schema is JSON")
}

#[test]
fn the_schema_has_the_ranges_and_defaults_of_the_parser() {
    let schema = schema();
    let at = |pointer: &str| schema.pointer(pointer).unwrap_or_else(|| panic!("{pointer}"));
    let number = |pointer: &str| at(pointer).as_f64().unwrap_or_else(|| panic!("{pointer}"));
    for (pointer, range) in [
        ("/$defs/Length/oneOf/0", Length::RANGE),
        ("/$defs/Radius/oneOf/0", (0.0, Position::RANGE.1)),
        ("/$defs/Height/oneOf/0", Height::RANGE),
        ("/$defs/Force/oneOf/0", Force::RANGE),
        ("/$defs/Stress/oneOf/0", Stress::RANGE),
        ("/$defs/Stiffness/oneOf/0", Stiffness::RANGE),
        ("/$defs/Volume/oneOf/0", Volume::RANGE),
        ("/$defs/Energy/oneOf/0", DissipatedEnergy::RANGE),
        ("/$defs/Position/oneOf/0", Position::RANGE),
        ("/$defs/Block/properties/amplitude/oneOf/0", Stroke::RANGE),
        ("/$defs/Block/properties/cycles", BlockCycles::RANGE),
        ("/$defs/Wear/oneOf/0/properties/share", Share::RANGE),
        ("/$defs/SlopeAngle/oneOf/0", SlopeAngle::RANGE),
        ("/properties/friction/oneOf/0", Friction::RANGE),
        ("/$defs/ForceBlock/properties/tangential_force/oneOf/0", BlockForce::RANGE),
        ("/$defs/ForceBlock/properties/cycles", BlockCycles::RANGE),
        ("/$defs/RunIn/properties/run_in/properties/cycles", BlockCycles::RANGE),
        ("/$defs/Body/properties/poisson_ratio", PoissonRatio::RANGE),
        ("/$defs/Profile/oneOf/3/properties/exponent", Exponent::RANGE),
        ("/$defs/Wear/oneOf/0/properties/coefficient/oneOf/0", WEAR_RANGE),
        ("/$defs/Wear/oneOf/2/properties/energy_coefficient/oneOf/0", EnergyWear::RANGE),
        ("/$defs/Motion/oneOf/1/properties/stick_ratio", StickRatio::RANGE),
        ("/$defs/Instants/items", Instant::RANGE),
        ("/$defs/Range/properties/from", Instant::RANGE),
        ("/$defs/Range/properties/to", (0.0, LAST_CYCLE)),
        ("/$defs/Range/properties/count", (2.0, MAX_CYCLES as f64)),
        ("/$defs/EnergyRange/properties/count", (2.0, MAX_CYCLES as f64)),
        ("/$defs/Model/properties/xi/oneOf/1", Xi::RANGE),
        ("/$defs/Model/properties/tolerance", Tolerance::RANGE),
        ("/$defs/Model/properties/points", (f64::from(POINTS_RANGE.0), f64::from(POINTS_RANGE.1))),
    ] {
        let found = (number(&format!("{pointer}/minimum")), number(&format!("{pointer}/maximum")));
        assert_eq!(found, range, "{pointer}");
    }
    assert_eq!(number("/$defs/Instants/maxItems"), MAX_CYCLES as f64);
    assert_eq!(number("/$defs/Energies/maxItems"), MAX_CYCLES as f64);
    let blocks = "/$defs/Motion/oneOf/3/properties/blocks/maxItems";
    assert_eq!(number(blocks), MAX_BLOCKS as f64);
    let reversals = "/$defs/Motion/oneOf/4/properties/reversals/maxItems";
    assert_eq!(number(reversals), MAX_REVERSALS as f64);
    for column in ["radius", "height"] {
        let column = format!("/$defs/Profile/oneOf/6/properties/{column}");
        assert_eq!(number(&format!("{column}/maxItems")), MAX_ROWS as f64);
    }
    for column in ["at", "values"] {
        let column = format!("/$defs/ChangeTable/properties/{column}");
        assert_eq!(number(&format!("{column}/maxItems")), MAX_CHANGES as f64);
    }
    assert_eq!(number("/$defs/WornBody/properties/layers/maxItems"), MAX_LAYERS as f64);
    assert_eq!(number("/$defs/Model/properties/tolerance/default"), DEFAULT_TOLERANCE);
    assert_eq!(number("/$defs/Model/properties/points/default"), f64::from(DEFAULT_POINTS));
}

#[test]
fn the_schema_names_every_accepted_unit() {
    let schema = schema();
    for (pointer, dimension) in [
        ("/$defs/Length", Dimension::Length),
        ("/$defs/Radius", Dimension::Length),
        ("/$defs/Height", Dimension::Length),
        ("/$defs/Force", Dimension::Force),
        ("/$defs/Stress", Dimension::Stress),
        ("/$defs/Stiffness", Dimension::Stiffness),
        ("/$defs/ForceOrPerLength", Dimension::ForcePerLength),
        ("/$defs/StiffnessOrPerLength", Dimension::StiffnessPerLength),
        ("/$defs/WearRate", Dimension::WearCoefficient),
        ("/$defs/Volume", Dimension::Volume),
        ("/$defs/Energy", Dimension::Energy),
        ("/$defs/SlopeAngle", Dimension::Angle),
        ("/$defs/Wear/oneOf/0/properties/coefficient", Dimension::WearCoefficient),
        ("/$defs/Wear/oneOf/2/properties/energy_coefficient", Dimension::EnergyWear),
    ] {
        let description = schema.pointer(pointer).expect(pointer)["description"].to_string();
        let (_, units) = description.split_once("Units: ").expect("a list of units");
        let named: Vec<&str> = units
            .split(", ")
            .map(|unit| unit.trim_end_matches(['"', '.']))
            .map(|unit| unit.split_once(" (").map_or(unit, |(plain, _)| plain))
            .collect();
        let accepted = dimension.accepted();
        let accepted: Vec<&str> = accepted.split(", ").collect();
        assert_eq!(named, accepted, "{pointer}");
    }
}

#[test]
fn all_examples_are_accepted() {
    let schema = schema();
    let examples = schema["examples"].as_array().expect("examples");
    for example in examples {
        scenario::check(example, "").unwrap_or_else(|faults| panic!("{faults:?}"));
    }
    for shape in schema["$defs"]["Profile"]["oneOf"].as_array().expect("shapes") {
        let mut scenario = examples[0].clone();
        let is_line = shape["required"].as_array().expect("members").contains(&json!("length"));
        if is_line {
            scenario["motion"] = json!({"tangential_force": "5 N/mm"});
        } else {
            scenario["load"] = json!({"indentation_depth": "2 um"});
        }
        for example in shape["examples"].as_array().into_iter().flatten() {
            scenario["profile"] = example.clone();
            scenario::check(&scenario, "").unwrap_or_else(|faults| panic!("{faults:?}"));
        }
    }
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
    let mut seen = 0;
    for entry in std::fs::read_dir(directory).expect(directory) {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let text = std::fs::read_to_string(&path).expect("a file");
            let body: Value = serde_json::from_str(&text).expect("JSON");
            scenario::check(&body["scenario"], "")
                .unwrap_or_else(|faults| panic!("{}: {faults:?}", path.display()));
            seen += 1;
        }
    }
    assert!(seen >= 3);
}
