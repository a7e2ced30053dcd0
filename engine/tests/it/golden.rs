//! Golden digits: checksums over every digit of some results. If this test fails, the digits of the
//! engine have changed. For an intended change, raise [`scenario::NUMERICS`].

use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

use crate::engine::steel_ball;

/// FNV-1a with 64 bits.
fn checksum(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The steel ball with some members of the request replaced.
fn ball_with(changes: &Value) -> Value {
    let mut request = steel_ball();
    for (name, value) in changes.as_object().expect("an object") {
        request[name] = value.clone();
    }
    request
}

/// The name of each case, its changes to the steel ball, and the expected checksum.
fn paraboloids() -> Vec<(&'static str, Value, u64)> {
    let blocks = json!({"blocks": [{"amplitude": "2 um", "cycles": 5000},
                                   {"amplitude": "1 um", "cycles": 1e6}]});
    let exact = json!({"method": "exact"});
    let depth = json!({"normal_force": "100 N", "held": "depth"});
    let force = json!({"normal_force": "100 N", "held": "force"});
    let cycles = json!([500, 5000, 6000, 50_000, 500_000]);
    let long = json!({"normalized": [0.5, 4, 16, 1000]});
    vec![
        ("simplified", json!({"cycles": long}), 0x8b4a_ff80_430a_d3e8),
        (
            "simplified, stopped",
            json!({"until": {"wear_depth": "0.5 um"}, "cycles": long}),
            0xe877_9ee7_438b_73ea,
        ),
        (
            "simplified, gross slip",
            json!({"motion": {"amplitude": "5 um"}, "cycles": long}),
            0x5f3f_d92b_9b98_45ff,
        ),
        ("exact", json!({"model": exact, "load": depth, "cycles": long}), 0x8eb5_a77b_f4b0_8b94),
        (
            "exact beside the rule",
            json!({"model": {"method": "exact", "compare": true}}),
            0x9b70_8d20_7b2c_c5a8,
        ),
        (
            "exact, force held, stopped",
            json!({"model": exact, "load": force, "until": {"wear_volume": "1e-3 mm^3"},
                   "cycles": long}),
            0x36d7_1774_bde6_7bbd,
        ),
        (
            "exact, both forces held, shared",
            json!({"model": exact, "load": force, "motion": {"tangential_force": "50 N"},
                   "wear": {"coefficient": "3.03e-5 mm^3/(N m)", "share": 0.3}, "cycles": long}),
            0xbcf5_e539_1194_da5a,
        ),
        (
            "exact, tangential force held",
            json!({"model": exact, "load": depth, "motion": {"tangential_force": "50 N"},
                   "cycles": long}),
            0xe65b_46ea_975a_9a91,
        ),
        (
            "exact, rig",
            json!({"model": exact, "load": force,
                   "motion": {"amplitude": "2.5 um", "rig_stiffness": "50 N/um"}}),
            0x99a4_5ba2_b40b_39ba,
        ),
        (
            "exact, blocks",
            json!({"model": exact, "load": depth, "motion": blocks, "cycles": cycles}),
            0x65b4_375a_07be_2705,
        ),
        (
            "simplified, blocks, force held",
            json!({"load": force, "motion": blocks, "cycles": cycles}),
            0x82be_55e7_174a_c268,
        ),
        (
            "exact, reversals",
            json!({"model": exact, "motion": {"reversals": ["2 um", "-2 um", "1 um", "-1.5 um"]},
                   "cycles": cycles, "profiles_at": [500, 50_000]}),
            0x4abe_18bc_132f_3420,
        ),
    ]
}

/// The same for other shapes of the indenter.
fn shapes() -> Vec<(&'static str, Value, u64)> {
    let table = json!({"shape": "table", "radius": [0, 1e-4, 2e-4, 3e-4, 4e-4, 6e-4, 8e-4],
                       "height": [0, 5.1e-7, 2e-6, 4.4e-6, 8e-6, 1.81e-5, 3.2e-5]});
    let exact = json!({"method": "exact"});
    let force = json!({"normal_force": "100 N", "held": "force"});
    vec![
        ("simplified, table", json!({"profile": table}), 0xc2c6_a82f_14fc_7892),
        (
            "exact, table",
            json!({"profile": table, "model": exact, "load": force}),
            0xe7d1_a04f_1417_2288,
        ),
        (
            "exact, truncated cone, gross slip",
            json!({"profile": {"shape": "truncated_cone", "slope_angle": "2 deg",
                               "flat_radius": "20 um"},
                   "motion": {"amplitude": "8 um"}, "model": exact, "load": force}),
            0x36c8_a556_c565_4289,
        ),
        (
            "simplified, power",
            json!({"profile": {"shape": "power", "exponent": 2.5, "height": "1 um",
                               "at_radius": "0.1 mm"}, "profiles_at": "last"}),
            0x04ed_62b3_44e9_a8ee,
        ),
    ]
}

#[test]
fn results_have_the_digits_of_this_numerics_version() {
    assert_eq!(scenario::NUMERICS, 2, "new digits: compute the checksums below anew");
    let mut changed = Vec::new();
    for (name, changes, expected) in paraboloids().into_iter().chain(shapes()) {
        let request = ball_with(&changes);
        let (scenario, warnings) = scenario::check(&request, "").expect(name);
        let preview = scenario.preview().expect(name);
        let outcome = Simulation::of(&scenario).expect(name).run();
        let text = json!([scenario, warnings, preview, outcome]).to_string();
        let found = checksum(&text);
        if found != expected {
            changed.push(format!("{name}: {found:#018x}"));
        }
    }
    assert!(changed.is_empty(), "{}", changed.join("\n"));
}
