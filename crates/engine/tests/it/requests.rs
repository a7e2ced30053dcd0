//! Requests of line contacts, of layers and of coefficients that change: what is read, and what is refused.

use deserr::{Deserr as _, IntoValue as _, ValuePointerRef};
use fretwork_engine::contact::geometry::Geometry;
use fretwork_engine::input::Request;
use fretwork_engine::input::changing::{ChangeTable, Changing, Over};
use fretwork_engine::input::fault::Faults;
use fretwork_engine::input::held::{Blocks, Reference};
use fretwork_engine::input::indenter::Profile;
use fretwork_engine::input::wear::WearLaw;
use fretwork_engine::scenario;
use serde_json::{Value, json};

/// A steel ball on steel.
fn round() -> Value {
    json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "110 GPa", "tangential": "93 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N"},
        "motion": {"amplitude": "2 um"},
        "cycles": [1000]
    })
}

/// A steel cylinder on steel. The length is a power of two, so that products with it are exact.
fn line() -> Value {
    let mut line = round();
    line["profile"] = json!({"shape": "cylinder", "radius": "6 mm", "length": 0.5});
    line["load"] = json!({"normal_force": "18.5 N/mm"});
    line["motion"] = json!({"tangential_force": "4 N/mm"});
    line
}

/// `base` with some of its members replaced.
fn with(mut base: Value, set: Value) -> Value {
    let Value::Object(set) = set else { panic!("no object: {set}") };
    for (member, value) in set {
        base[member] = value;
    }
    base
}

fn read(scenario: Value) -> Result<Request, Faults> {
    Request::deserialize_from_value(scenario.into_value(), ValuePointerRef::Origin)
}

fn accepted(scenario: &Value) -> Request {
    read(scenario.clone()).unwrap_or_else(|faults| panic!("{scenario}: {faults:?}"))
}

/// Checks that each scenario has exactly one fault, at this place and with these words.
fn have_one_fault(
    base: &Value,
    cases: impl IntoIterator<Item = (Value, &'static str, &'static str)>,
) {
    for (set, place, says) in cases {
        let faults = read(with(base.clone(), set.clone())).expect_err(&set.to_string()).0;
        let found: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
        assert_eq!(found, [place], "{set}: {faults:?}");
        assert!(faults[0].detail.contains(says), "{set}: {}", faults[0].detail);
    }
}

#[test]
fn forces_and_stiffnesses_per_length_are_multiplied_by_the_length() {
    let request = accepted(&line());
    assert_eq!(request.profile.geometry(), Geometry::Line);
    assert_eq!(request.profile.length(), Some(0.5));
    assert_eq!(request.load.normal_force.0.expect("a force").0, 9250.0);
    assert_eq!(request.motion.tangential_force.0.expect("a force").0, 2000.0);
    let request = accepted(&with(line(), json!({"load": {"normal_force": "9250 N"}})));
    assert_eq!(request.load.normal_force.0.expect("a force").0, 9250.0);

    let stroke = json!({"motion": {
        "amplitude": "25 um", "reference_distance": "10 mm", "rig_stiffness": "2 N/um/mm"
    }});
    let reference = accepted(&with(line(), stroke)).motion.reference();
    assert_eq!(
        reference,
        Some(Reference::Distance { reference_distance: 0.01, rig_stiffness: Some(1e9) })
    );
    for (stiffness, total) in [("3 N/mm^2", 1.5e6), ("3 N/mm/mm", 1.5e6), ("3 N/mm", 3000.0)] {
        let stroke = json!({"motion": {"amplitude": "25 um", "loop_stiffness": stiffness}});
        let reference = accepted(&with(line(), stroke)).motion.reference();
        assert_eq!(reference, Some(Reference::Loop { loop_stiffness: total }), "{stiffness}");
    }

    let blocks = json!([
        {"tangential_force": "4 N/mm", "cycles": 10},
        {"tangential_force": 0, "cycles": 5},
        {"tangential_force": "1 kN", "cycles": 5}
    ]);
    let request = accepted(&with(line(), json!({"motion": {"blocks": blocks}})));
    let Some(Blocks(blocks)) = request.motion.blocks.0 else { panic!("no blocks") };
    let forces = blocks.iter().map(|block| block.tangential_force.0.map(|force| force.0));
    assert_eq!(forces.collect::<Vec<_>>(), [Some(2000.0), Some(0.0), Some(1000.0)]);
}

#[test]
fn each_shape_of_a_line_contact_is_read_and_a_round_power_law_stays_round() {
    for shape in [
        json!({"shape": "wedge", "slope_angle": "2 deg"}),
        json!({"shape": "punch", "flat_half_width": "1 mm", "edge_radius": "3 mm"}),
        json!({"shape": "power", "exponent": 4, "height": 1e-6, "at_radius": 1e-4, "geometry": "line"}),
        json!({"shape": "table", "radius": [0, 1e-4], "height": [0, 1e-6], "geometry": "line"}),
    ] {
        let profile = with(shape, json!({"length": "8 mm"}));
        let request = accepted(&with(line(), json!({"profile": profile})));
        assert_eq!(request.profile.length(), Some(0.008), "{profile}");
    }
    let power = json!({"shape": "power", "exponent": 4, "height": 1e-6, "at_radius": 1e-4});
    let round_power = with(power.clone(), json!({"geometry": "round"}));
    let [power, round_power] = [power, round_power]
        .map(|power| accepted(&with(round(), json!({"profile": power}))).profile);
    assert_eq!(power.geometry(), Geometry::Round);
    assert_eq!(power, round_power);
    let written = serde_json::to_string(&power).expect("JSON");
    assert_eq!(written, r#"{"shape":"power","exponent":4.0,"height":1e-6,"at_radius":0.0001}"#);
}

#[test]
fn shapes_with_a_wrong_length_or_geometry_are_refused() {
    let profile = |profile: Value| json!({"profile": profile});
    let power = json!({"shape": "power", "exponent": 4, "height": 1e-6, "at_radius": 1e-4});
    have_one_fault(
        &line(),
        [
            (
                profile(json!({"shape": "cylinder", "radius": "6 mm"})),
                "/profile/length",
                "such as \"10 mm\"",
            ),
            (
                profile(with(power.clone(), json!({"geometry": "line"}))),
                "/profile/length",
                "such as \"10 mm\"",
            ),
            (
                profile(
                    json!({"shape": "cylinder", "radius": 0.006, "length": 0.5, "geometry": "line"}),
                ),
                "/profile/geometry",
                "Remove `geometry`",
            ),
        ],
    );
    have_one_fault(
        &round(),
        [
            (
                profile(json!({"shape": "sphere", "radius": 0.01, "length": 0.5})),
                "/profile/length",
                "\"cylinder\"",
            ),
            (
                profile(with(power.clone(), json!({"length": 0.5}))),
                "/profile/length",
                "add \"geometry\": \"line\"",
            ),
            (
                profile(json!({"shape": "cone", "slope_angle": 0.1, "geometry": "line"})),
                "/profile/geometry",
                "\"wedge\"",
            ),
            (
                profile(with(power, json!({"geometry": "square"}))),
                "/profile/geometry",
                "round, line",
            ),
        ],
    );
}

#[test]
fn crossed_cylinders_are_round_up_to_a_ratio_of_their_radii() {
    let crossed = |radii: Value| json!({"profile": {"shape": "crossed_cylinders", "radii": radii}});
    for radii in [json!(["10 mm", "15 mm"]), json!([0.015, 0.01])] {
        let request = accepted(&with(round(), crossed(radii)));
        assert_eq!(request.profile.geometry(), Geometry::Round);
        let Profile::CrossedCylinders(crossed) = request.profile else { panic!("other shape") };
        assert!((crossed.radii.mean() - 0.012_247_448_713_9).abs() < 1e-13);
    }
    have_one_fault(
        &round(),
        [
            (crossed(json!(["8 mm", "32 mm"])), "/profile/radii", "\"radius\": 0.016"),
            (crossed(json!(["8 mm"])), "/profile/radii", "exactly two radii"),
            (crossed(json!(["8 mm", "9 kg"])), "/profile/radii/1", "unknown unit"),
        ],
    );
}

#[test]
fn what_only_a_line_contact_has_is_refused_for_a_round_one() {
    let motion = |motion: Value| json!({"motion": motion});
    have_one_fault(
        &round(),
        [
            (
                json!({"load": {"normal_force": "18.5 N/mm"}}),
                "/load/normal_force",
                "such as \"1 N\"",
            ),
            (
                motion(json!({"tangential_force": "4 N/mm"})),
                "/motion/tangential_force",
                "a force per length",
            ),
            (
                motion(json!({"amplitude": 2e-6, "rig_stiffness": "2 N/mm/mm"})),
                "/motion/rig_stiffness",
                "a stiffness per length",
            ),
            (
                motion(json!({"amplitude": 2e-6, "reference_distance": 0.01})),
                "/motion/reference_distance",
                "Remove `reference_distance`",
            ),
            (
                motion(json!({"amplitude": 2e-6, "loop_stiffness": 1e7})),
                "/motion/loop_stiffness",
                "`rig_stiffness`",
            ),
            (
                motion(json!({"sliding_amplitude": 2e-6})),
                "/motion/sliding_amplitude",
                "`amplitude`",
            ),
            (
                motion(json!({"blocks": [{"tangential_force": 40, "cycles": 10}]})),
                "/motion/blocks/0/tangential_force",
                "Enter `amplitude`",
            ),
        ],
    );
}

#[test]
fn what_a_line_contact_does_not_have_is_refused() {
    let motion = |motion: Value| json!({"motion": motion});
    let model = |model: Value| json!({"model": model});
    have_one_fault(
        &line(),
        [
            (
                json!({"load": {"indentation_depth": "1 um"}}),
                "/load/indentation_depth",
                "`normal_force`, such as \"18.5 N/mm\"",
            ),
            (
                json!({"load": {"normal_force": 100, "held": "depth"}}),
                "/load/held",
                "must be \"force\"",
            ),
            (motion(json!({"reversals": [0, 1e-6]})), "/motion/reversals", "`blocks`"),
            (motion(json!({"amplitude": "25 um"})), "/motion/amplitude", "`reference_distance`"),
            (
                motion(json!({"amplitude": "25 um", "rig_stiffness": "2 N/mm/mm"})),
                "/motion/amplitude",
                "`reference_distance`",
            ),
            (
                motion(json!({"blocks": [{"amplitude": 1e-6, "cycles": 10}]})),
                "/motion/blocks/0/amplitude",
                "`reference_distance`",
            ),
            (
                motion(json!({"stick_ratio": 0.5, "held": "amplitude"})),
                "/motion/held",
                "must be \"tangential_force\"",
            ),
            (
                motion(
                    json!({"amplitude": 1e-6, "reference_distance": 0.01, "held": "tangential_force"}),
                ),
                "/motion/held",
                "must be \"amplitude\"",
            ),
            (
                motion(json!({"sliding_amplitude": "25 um", "reference_distance": 0.01})),
                "/motion/reference_distance",
                "no effect",
            ),
            (
                motion(json!({"sliding_amplitude": "25 um", "rig_stiffness": 1e7})),
                "/motion/rig_stiffness",
                "no effect",
            ),
            (
                motion(
                    json!({"amplitude": 1e-6, "reference_distance": 0.01, "loop_stiffness": 1e7}),
                ),
                "/motion/reference_distance",
                "combined with `loop_stiffness`",
            ),
            (
                motion(json!({"amplitude": 1e-6, "rig_stiffness": 1e7, "loop_stiffness": 1e7})),
                "/motion/rig_stiffness",
                "combined with `loop_stiffness`",
            ),
            (model(json!({"method": "simplified"})), "/model/method", "a line contact"),
            (model(json!({"xi": 0.8})), "/model/xi", "Remove `xi`"),
            (model(json!({"compare": true})), "/model/compare", "a line contact"),
            (
                json!({"load": {"normal_force": "18.5 N/cm"}}),
                "/load/normal_force",
                "for a line contact also N/m",
            ),
            (
                json!({"load": {"normal_force": "1e18 N/mm"}}),
                "/load/normal_force",
                "must be between",
            ),
        ],
    );
}

#[test]
fn blocks_of_two_kinds_are_refused() {
    let blocks = |blocks: Value| json!({"motion": {"blocks": blocks}});
    let force = |force: f64| json!({"tangential_force": force, "cycles": 10});
    have_one_fault(
        &line(),
        [
            (
                blocks(json!([force(10.0), {"amplitude": 1e-6, "cycles": 10}])),
                "/motion/blocks/1/amplitude",
                "Enter `tangential_force` in all blocks",
            ),
            (
                blocks(json!([{"tangential_force": 1, "amplitude": 1e-6, "cycles": 10}])),
                "/motion/blocks/0/tangential_force",
                "only one",
            ),
            (blocks(json!([{"cycles": 10}])), "/motion/blocks/0/amplitude", "is missing"),
            (
                blocks(json!([force(0.0), force(10.0)])),
                "/motion/blocks/0/tangential_force",
                "in the first block",
            ),
            (
                json!({"motion": {"blocks": [force(10.0)], "held": "amplitude"}}),
                "/motion/held",
                "must be \"tangential_force\"",
            ),
        ],
    );
}

#[test]
fn faults_that_depend_on_the_geometry_are_reported_together() {
    let scenario = with(
        line(),
        json!({
            "load": {"indentation_depth": 1e-6}, "motion": {"amplitude": 1e-6},
            "model": {"method": "simplified", "xi": 1.0},
        }),
    );
    let faults = read(scenario).expect_err("four faults").0;
    let places: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
    let expected = ["/load/indentation_depth", "/motion/amplitude", "/model/method", "/model/xi"];
    assert_eq!(places, expected);
}

fn table(over: Over, at: &[f64], values: &[f64]) -> Changing {
    Changing::Table(ChangeTable { over, at: at.to_vec(), values: values.to_vec() })
}

#[test]
fn a_coefficient_can_change_over_cycles_or_over_energy() {
    let friction =
        |friction: Value| accepted(&with(round(), json!({"friction": friction}))).friction.0;
    let run_in = friction(json!({"run_in": {"cycles": 1000, "from": 0.2, "to": 0.8}}));
    assert_eq!(run_in, table(Over::Cycles, &[0.0, 1000.0], &[0.2, 0.8]));
    let step = json!({"over": "dissipated_energy", "at": ["50 mJ", 0.05, "1 J"], "values": [0.2, 0.4, 0.8]});
    assert_eq!(friction(step), table(Over::DissipatedEnergy, &[0.05, 0.05, 1.0], &[0.2, 0.4, 0.8]));
    let wear = |wear: Value| accepted(&with(round(), json!({"wear": wear}))).wear.law;
    let run_in = json!({"run_in": {"cycles": 10, "from": "1e-5 mm^3/(N m)", "to": 2e-14}});
    let expected = WearLaw::PerLoad(table(Over::Cycles, &[0.0, 10.0], &[1e-14, 2e-14]));
    assert_eq!(wear(json!({"coefficient": run_in})), expected);
    let archard = json!({"over": "cycles", "at": [0, 10], "values": [1e-4, 2e-4]});
    let expected = WearLaw::PerLoad(table(Over::Cycles, &[0.0, 10.0], &[1e-13, 2e-13]));
    assert_eq!(wear(json!({"coefficient": archard, "hardness": "1 GPa"})), expected);
}

/// The same key means that both scenarios are the same run.
#[test]
fn a_table_of_equal_values_is_the_number() {
    let constant =
        json!({"over": "cycles", "at": [0, 10, 10], "values": [0.7, 0.7, 0.700_000_000_000_01]});
    let run_in = json!({"run_in": {"cycles": 10, "from": "3.03e-5 mm^3/(N m)", "to": 3.03e-14}});
    let changed = with(round(), json!({"friction": constant, "wear": {"coefficient": run_in}}));
    assert_eq!(canonical(&changed), canonical(&round()));
}

/// The canonical form of a scenario, from which its key follows.
fn canonical(scenario: &Value) -> String {
    let (scenario, _) = scenario::check(scenario, "").expect("a scenario");
    serde_json::to_string(&scenario).expect("JSON")
}

#[test]
fn motions_that_mean_the_same_have_one_canonical_form() {
    let of = |base: &Value, motion: Value| {
        let mut scenario = base.clone();
        (scenario["motion"], scenario["cycles"]) = (motion, json!([100, 1000]));
        canonical(&scenario)
    };
    // One block, or several equal ones, until the last output cycle or beyond.
    let block = |amplitude: &str, cycles: u32| json!({"amplitude": amplitude, "cycles": cycles});
    let constant = of(&round(), json!({"amplitude": "2 um"}));
    for blocks in [vec![block("2 um", 1000)], vec![block("2 um", 500), block("2000 nm", 700)]] {
        assert_eq!(of(&round(), json!({"blocks": blocks})), constant);
    }
    let two = json!({"blocks": [block("2 um", 500), block("1 um", 700)]});
    assert_ne!(of(&round(), two), constant);
    let forces = json!({"blocks": [{"tangential_force": "20 N", "cycles": 1000}]});
    assert_eq!(of(&line(), forces), of(&line(), json!({"tangential_force": "20 N"})));
    let strokes = json!({"blocks": [block("2 um", 1000)], "reference_distance": "5 mm"});
    let stroke = json!({"amplitude": "2 um", "reference_distance": "5 mm"});
    assert_eq!(of(&line(), strokes), of(&line(), stroke));
    // A record counts from any position.
    let record = |shift: f64| {
        let positions = [2.1, -1.4, 0.6, -2.1, 0.3].map(|position| 1e-6 * (position + shift));
        of(&round(), json!({"reversals": positions}))
    };
    for shift in [0.7, -33.3, 1e3] {
        assert_eq!(record(shift), record(0.0));
    }
    let (again, _) = scenario::check(&serde_json::from_str(&record(0.7)).expect("JSON"), "")
        .expect("a scenario");
    assert_eq!(serde_json::to_string(&again).expect("JSON"), record(0.7));
}

#[test]
fn faulty_tables_of_a_coefficient_are_refused() {
    let over_cycles = |at: Value, values: Value| json!({"friction": {"over": "cycles", "at": at, "values": values}});
    let run_in = |run_in: Value| json!({"friction": {"run_in": run_in}});
    have_one_fault(
        &round(),
        [
            (over_cycles(json!([0, 5, 4]), json!([0.2, 0.3, 0.4])), "/friction/at/2", "Sort"),
            (over_cycles(json!([0, 0]), json!([0.2, 0.3])), "/friction/at/1", "a step at 0"),
            (
                over_cycles(json!([5, 5, 5]), json!([0.2, 0.3, 0.4])),
                "/friction/at/2",
                "more than twice",
            ),
            (over_cycles(json!([0, 5]), json!([0.2, 0.3, 0.4])), "/friction/values", "as many"),
            (over_cycles(json!([0, 5]), json!([0.2, 0])), "/friction/values/1", "greater than 0"),
            (over_cycles(json!([0]), json!([0.2, 0.3])), "/friction/at", "2 to 1000"),
            (json!({"friction": [0.2, 0.3]}), "/friction", "or a table such as"),
            (
                json!({"friction": {"run_in": {"cycles": 9, "from": 0.2, "to": 0.3}, "over": "cycles"}}),
                "/friction/run_in",
                "alone, or a table",
            ),
            (over_cycles(json!([0, "5 mJ"]), json!([0.2, 0.3])), "/friction/at/1", "plain number"),
            (
                json!({"friction": {"at": [0, 5], "values": [0.2, 0.3]}}),
                "/friction/over",
                "\"cycles\" or \"dissipated_energy\"",
            ),
            (
                json!({"friction": {"over": "time", "at": [0, 5], "values": [0.2, 0.3]}}),
                "/friction/over",
                "cycles, dissipated_energy",
            ),
            (
                run_in(json!({"cycles": 0, "from": 0.2, "to": 0.3})),
                "/friction/run_in/cycles",
                "greater than 0",
            ),
            (
                run_in(json!({"cycles": 9, "from": 0.2, "to": 300})),
                "/friction/run_in/to",
                "between",
            ),
            (
                json!({"wear": {"coefficient": {"run_in": {"cycles": 9, "from": "1 m", "to": 1e-14}}}}),
                "/wear/coefficient/run_in/from",
                "a wear coefficient is needed",
            ),
            (
                json!({"wear": {"energy_coefficient": {"run_in": {"cycles": 9, "from": 1e-14, "to": 2e-14}}}}),
                "/wear/energy_coefficient",
                "not an object",
            ),
            (
                json!({
                    "friction": {"run_in": {"cycles": 9, "from": 0.2, "to": 0.3}},
                    "model": {"method": "simplified"},
                }),
                "/model/method",
                "this friction changes",
            ),
        ],
    );
}

#[test]
fn layers_are_read_from_the_surface_inwards() {
    let layer = |thickness: &str, k: &str| json!({"thickness": thickness, "coefficient": k});
    let bodies = json!([
        {"coefficient": 0},
        {"layers": [layer("2 um", "1e-6 mm^3/(N m)"), layer("1 um", "1e-14")], "coefficient": 3e-14}
    ]);
    let wear = accepted(&with(round(), json!({"wear": {"bodies": bodies}}))).wear;
    let WearLaw::Layered([first, second]) = wear.law else { panic!("no layers") };
    assert_eq!((first.layers.0.len(), first.coefficient.0), (0, 0.0));
    let layers: Vec<(f64, f64)> =
        second.layers.0.iter().map(|layer| (layer.thickness.0, layer.coefficient.0)).collect();
    assert_eq!(layers, [(2e-6, 1e-15), (1e-6, 1e-14)]);
    assert_eq!(second.coefficient.0, 3e-14);
}

#[test]
fn bodies_without_layers_are_a_coefficient_and_a_share() {
    let bodies =
        json!([{"coefficient": "1e-14"}, {"layers": [], "coefficient": "3e-5 mm^3/(N m)"}]);
    let wear = accepted(&with(round(), json!({"wear": {"bodies": bodies}}))).wear;
    let both =
        accepted(&with(round(), json!({"wear": {"coefficient": 4e-14, "share": 0.25}}))).wear;
    assert_eq!(wear, both);
}

#[test]
fn faulty_bodies_and_layers_are_refused() {
    let layered = json!([
        {"coefficient": 1e-14},
        {"layers": [{"thickness": "2 um", "coefficient": 0}], "coefficient": 3e-14}
    ]);
    let beside =
        |member: &str, value: Value| json!({"wear": {"bodies": layered.clone(), (member): value}});
    let bodies = |bodies: Value| json!({"wear": {"bodies": bodies}});
    have_one_fault(
        &round(),
        [
            (beside("coefficient", json!(1e-14)), "/wear/coefficient", "Remove `coefficient`"),
            (beside("share", json!(0.5)), "/wear/share", "Remove `share`"),
            (beside("hardness", json!(1e9)), "/wear/hardness", "Remove `hardness`"),
            (
                beside("energy_coefficient", json!(1e-14)),
                "/wear/energy_coefficient",
                "Remove `energy_coefficient`",
            ),
            (bodies(json!([{"coefficient": 1e-14}])), "/wear/bodies", "exactly two bodies"),
            (
                bodies(json!([{"coefficient": 0}, layered[1].clone()])),
                "/wear/bodies",
                "stop the wear",
            ),
            (
                bodies(json!([{"coefficient": 0}, {"coefficient": {"run_in": {}}}])),
                "/wear/bodies/1/coefficient",
                "cannot be a table",
            ),
            (
                bodies(json!([{"coefficient": 1e-40}, {"coefficient": 1e-14}])),
                "/wear/bodies/0/coefficient",
                "between",
            ),
            (
                bodies(
                    json!([{"coefficient": 1e-14}, {"layers": [{"thickness": 1e-6}], "coefficient": 0}]),
                ),
                "/wear/bodies/1/layers/0/coefficient",
                "is missing",
            ),
            (
                json!({"wear": {"bodies": layered.clone()}, "model": {"compare": true}}),
                "/model/compare",
                "these bodies have layers",
            ),
        ],
    );
}
