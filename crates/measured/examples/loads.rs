use fretwork_measured::{Prepare, Wanted, read};
fn main() {
    let wanted = Wanted {
        x: None,
        y: None,
        prepare: Prepare::Trace,
        level: true,
        centre: true,
        up: None,
        scar: None,
    };
    let m = read(&std::fs::read("/tmp/h59t/ball.csv").unwrap(), &wanted).unwrap();
    let profile = &m.prepared["indenter"];
    if let Some(r) = profile["radius"].as_array() {
        for (r, h) in r.iter().zip(profile["height"].as_array().unwrap()).take(60) {
            println!("{r} {h}");
        }
    }
    for load in [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0] {
        let request = serde_json::json!({
            "profile": profile, "moduli": {"normal": 1e11, "tangential": 1e11}, "friction": 0.5,
            "wear": {"coefficient": 1e-14}, "load": {"normal_force": load}, "motion": {"amplitude": 1e-6}, "cycles": [1],
        });
        println!(
            "{load} {:?}",
            fretwork_engine::scenario::check(&request, "").err().map(|f| f
                .0
                .iter()
                .map(|f| format!("{} {}", f.pointer, f.detail))
                .collect::<Vec<_>>())
        );
    }
}
