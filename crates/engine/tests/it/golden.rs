//! Golden digits: checksums over every digit of some results. If this test fails, the digits of the
//! engine have changed. For an intended change, raise [`scenario::NUMERICS`].

use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

use crate::engine::steel_ball;

/// The 64-bit FNV-1a hash of a text.
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
        ("simplified", json!({"cycles": long}), 0x5084_1583_f20a_1b39),
        (
            "simplified, stopped",
            json!({"until": {"wear_depth": "0.5 um"}, "cycles": long}),
            0xb6bd_a291_80aa_5f55,
        ),
        (
            "simplified, gross slip",
            json!({"motion": {"amplitude": "5 um"}, "cycles": long}),
            0x18d5_891b_fa45_b7dd,
        ),
        ("exact", json!({"model": exact, "load": depth, "cycles": long}), 0x563a_27d6_a808_10ca),
        (
            "exact beside the rule",
            json!({"model": {"method": "exact", "compare": true}}),
            0x66ca_1b5b_7caf_31a3,
        ),
        (
            "exact, force held, stopped",
            json!({"model": exact, "load": force, "until": {"wear_volume": "1e-3 mm^3"},
                   "cycles": long}),
            0xda3b_5cba_95b9_b866,
        ),
        (
            "exact, both forces held, shared",
            json!({"model": exact, "load": force, "motion": {"tangential_force": "50 N"},
                   "wear": {"coefficient": "3.03e-5 mm^3/(N m)", "share": 0.3}, "cycles": long}),
            0x1326_d759_ae6e_bcf9,
        ),
        (
            "exact, tangential force held",
            json!({"model": exact, "load": depth, "motion": {"tangential_force": "50 N"},
                   "cycles": long}),
            0x2fcb_2c29_cb6f_9172,
        ),
        (
            "exact, rig",
            json!({"model": exact, "load": force,
                   "motion": {"amplitude": "2.5 um", "rig_stiffness": "50 N/um"}}),
            0x3e30_d142_03da_d41a,
        ),
        (
            "exact, blocks",
            json!({"model": exact, "load": depth, "motion": blocks, "cycles": cycles}),
            0x7854_9d74_dfd7_cd5a,
        ),
        (
            "simplified, blocks, force held",
            json!({"load": force, "motion": blocks, "cycles": cycles}),
            0x4ab5_5a41_6b97_0c6d,
        ),
        (
            "exact, reversals",
            json!({"model": exact, "motion": {"reversals": ["2 um", "-2 um", "1 um", "-1.5 um"]},
                   "cycles": cycles, "profiles_at": [500, 50_000]}),
            0x6bcb_730e_0bad_8081,
        ),
    ]
}

/// The same list for other shapes of the indenter.
fn shapes() -> Vec<(&'static str, Value, u64)> {
    let table = json!({"shape": "table", "radius": [0, 1e-4, 2e-4, 3e-4, 4e-4, 6e-4, 8e-4],
                       "height": [0, 5.1e-7, 2e-6, 4.4e-6, 8e-6, 1.81e-5, 3.2e-5]});
    let exact = json!({"method": "exact"});
    let force = json!({"normal_force": "100 N", "held": "force"});
    vec![
        ("simplified, table", json!({"profile": table}), 0x1602_b656_848c_11c1),
        (
            "exact, table",
            json!({"profile": table, "model": exact, "load": force}),
            0x7ad8_d14f_85f0_0000,
        ),
        (
            "exact, truncated cone, gross slip",
            json!({"profile": {"shape": "truncated_cone", "slope_angle": "2 deg",
                               "flat_radius": "20 um"},
                   "motion": {"amplitude": "8 um"}, "model": exact, "load": force}),
            0xc5ee_32b4_92e0_4d84,
        ),
        (
            "simplified, power",
            json!({"profile": {"shape": "power", "exponent": 2.5, "height": "1 um",
                               "at_radius": "0.1 mm"}, "profiles_at": "last"}),
            0x7ff4_0247_3f9f_014e,
        ),
    ]
}

#[test]
fn results_have_the_digits_of_this_numerics_version() {
    assert_eq!(scenario::NUMERICS, 5, "new digits: compute the checksums below again");
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
