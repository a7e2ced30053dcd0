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
        ("simplified", json!({"cycles": long}), 0xa4e1_d321_e532_91b4),
        (
            "simplified, stopped",
            json!({"until": {"wear_depth": "0.5 um"}, "cycles": long}),
            0xc459_551e_9220_d646,
        ),
        (
            "simplified, gross slip",
            json!({"motion": {"amplitude": "5 um"}, "cycles": long}),
            0xc52f_ac57_1ddf_40cb,
        ),
        ("exact", json!({"model": exact, "load": depth, "cycles": long}), 0xa046_5ce3_15b8_131c),
        (
            "exact beside the rule",
            json!({"model": {"method": "exact", "compare": true}}),
            0x114b_139e_e0b6_2d57,
        ),
        (
            "exact, force held, stopped",
            json!({"model": exact, "load": force, "until": {"wear_volume": "1e-3 mm^3"},
                   "cycles": long}),
            0x41f1_3fc1_057a_6e35,
        ),
        (
            "exact, both forces held, shared",
            json!({"model": exact, "load": force, "motion": {"tangential_force": "50 N"},
                   "wear": {"coefficient": "3.03e-5 mm^3/(N m)", "share": 0.3}, "cycles": long}),
            0x17cd_7c9e_9bd4_5e1d,
        ),
        (
            "exact, tangential force held",
            json!({"model": exact, "load": depth, "motion": {"tangential_force": "50 N"},
                   "cycles": long}),
            0x9ae5_8086_90c4_3840,
        ),
        (
            "exact, rig",
            json!({"model": exact, "load": force,
                   "motion": {"amplitude": "2.5 um", "rig_stiffness": "50 N/um"}}),
            0x7dd9_4f3e_0800_298a,
        ),
        (
            "exact, blocks",
            json!({"model": exact, "load": depth, "motion": blocks, "cycles": cycles}),
            0x0ca3_1cb6_ca82_5fcc,
        ),
        (
            "simplified, blocks, force held",
            json!({"load": force, "motion": blocks, "cycles": cycles}),
            0xbf50_b2f9_041d_4d34,
        ),
        (
            "exact, reversals",
            json!({"model": exact, "motion": {"reversals": ["2 um", "-2 um", "1 um", "-1.5 um"]},
                   "cycles": cycles, "profiles_at": [500, 50_000]}),
            0x340f_4a58_4836_64ed,
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
        ("simplified, table", json!({"profile": table}), 0x9dce_ef9c_d83a_083b),
        (
            "exact, table",
            json!({"profile": table, "model": exact, "load": force}),
            0xb2a5_51f1_f469_f8e0,
        ),
        (
            "exact, truncated cone, gross slip",
            json!({"profile": {"shape": "truncated_cone", "slope_angle": "2 deg",
                               "flat_radius": "20 um"},
                   "motion": {"amplitude": "8 um"}, "model": exact, "load": force}),
            0xb97a_cbac_7bd6_80f2,
        ),
        (
            "simplified, power",
            json!({"profile": {"shape": "power", "exponent": 2.5, "height": "1 um",
                               "at_radius": "0.1 mm"}, "profiles_at": "last"}),
            0x98e7_26a7_761e_6688,
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
