//! Results over HTTP contain the numbers of the reference table.

use serde_json::{Value, json};

use crate::server::{JSON, Server};

/// All profiles that describe the indenter f = rⁿ/κₙ in units of a₀ = 1 mm and d₀ = 1 µm.
fn profiles(exponent: f64) -> Vec<Value> {
    let (radius, depth) = (1e-3, 1e-6);
    // κₙ = √π·Γ(n/2 + 1)/Γ(n/2 + 1/2), so that g = xⁿ: equation (3) of the source.
    let kappa = match exponent {
        1.0 => std::f64::consts::FRAC_PI_2,
        2.0 => 2.0,
        4.0 => 8.0 / 3.0,
        other => panic!("no κ for the exponent {other}"),
    };
    let height = depth / kappa;
    let power =
        json!({"shape": "power", "exponent": exponent, "height": height, "at_radius": radius});
    let own = match exponent {
        1.0 => Some(json!({"shape": "cone", "slope_angle": (height / radius).atan()})),
        2.0 => Some(json!({"shape": "paraboloid", "radius": radius * radius / depth})),
        _ => None,
    };
    std::iter::once(power).chain(own).collect()
}

/// Source: V. L. Popov, Sci. Rep. 4 (2014) 3749, evaluated in crates/engine/src/reference/reference.json.
#[tokio::test(flavor = "multi_thread")]
async fn results_agree_with_the_limits_of_the_reference_table() {
    let table: Value = serde_json::from_str(fretwork_engine::reference::TABLE).unwrap();
    let rows = table["limit_depth_and_amplitude_held"].as_array().unwrap();
    assert_eq!(rows.len(), 15);
    let server = Server::start().await;
    let mut asked = 0;
    for row in rows {
        let expected = |name: &str| row[name].as_f64().unwrap();
        for profile in profiles(expected("exponent")) {
            let body = json!({"scenario": {
                "profile": profile,
                "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
                "friction": 0.7,
                "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
                "load": {"indentation_depth": "1 um"},
                "motion": {"stick_ratio": row["stick_radius"]},
                "cycles": {"normalized": [1]},
            }});
            let headers = [JSON, ("Prefer", "wait=60")];
            let target = "/v1/jobs?include=result";
            let reply = server.send("POST", target, &headers, body.to_string()).await;
            let job = reply.json();
            assert_eq!((reply.status, &job["state"]), (200, &json!("succeeded")), "{job}");
            let number = |pointer: &str| {
                let value = job["result"].pointer(pointer).and_then(Value::as_f64);
                value.unwrap_or_else(|| panic!("no number at {pointer} in {}", job["result"]))
            };
            let (a, d) = (number("/scales/contact_radius"), number("/scales/indentation_depth"));
            assert!((a / 1e-3 - 1.0).abs() < 1e-10 && (d / 1e-6 - 1.0).abs() < 1e-10, "{a}, {d}");
            for (name, value, tolerance) in [
                ("stick_radius", number("/limit/stick_radius") / a, 1e-5),
                ("limiting_radius", number("/limit/contact_radius") / a, 1e-5),
                ("wear_volume", number("/limit/wear_volume") / (a * a * d), 1e-5),
                ("wear_depth", number("/limit/wear_depth") / d, 1e-5),
                ("depth_radius", number("/limit/wear_depth_radius") / a, 1e-4),
                (
                    "normal_force_ratio",
                    number("/limit/normal_force") / number("/scales/normal_force"),
                    1e-5,
                ),
            ] {
                let off = (value - expected(name)).abs();
                assert!(off <= tolerance, "{name} {value} in {row} of {profile}");
            }
            asked += 1;
        }
    }
    assert_eq!(asked, 15 + 13, "thirteen rows are cones or paraboloids too");
}
