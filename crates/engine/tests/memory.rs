//! Memory use of the engine: evaluating the wear rate allocates nothing, and a run stays below 100
//! MB.

use std::sync::Arc;

use allocation_counter::measure;
use fretwork_engine::contact::control::{Control, Held, Normal};
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::record::DisplacementRecord;
use fretwork_engine::contact::row::UnwornSums;
use fretwork_engine::contact::unworn::Contact;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_engine::solver::stepped::law::{Law, WearProblem};
use fretwork_engine::solver::stepped::plan::MeshPlan;
use fretwork_engine::solver::stepped::rkc::Rates;
use fretwork_engine::solver::stepped::wearing::Wearing;
use serde_json::json;

#[test]
fn evaluating_the_wear_rate_allocates_nothing() {
    let contact = Contact::sticking(Shape::power(2.0), 0.5).expect("a limit");
    let force = UnwornSums::of(&contact, None).tangential;
    let threshold = contact.threshold;
    let record = DisplacementRecord::new(&[1.0, -1.0, 0.4]).expect("motion");
    for held in [
        Held::Threshold,
        Held::Force(force),
        Held::Rig { amplitude: threshold + force, compliance: 0.5 },
        Held::Record(Arc::new(record)),
    ] {
        for normal in [Normal::Depth, Normal::Force] {
            for law in [Law::Exact, Law::Simplified(0.8)] {
                let control = Control::constant(normal, held.clone(), threshold);
                let plan = MeshPlan::first(&contact, &control, 64).expect("a scar that fits");
                let mut wearing = Wearing::new(
                    WearProblem { contact: &contact, control: &control, law },
                    (plan, Arc::default()),
                    64,
                );
                let (values, mut rates) = (vec![1e-3; 65], vec![0.0; 65]);
                wearing.rates(0.0, &values, &mut rates);
                let used = measure(|| {
                    for _ in 0..100 {
                        wearing.rates(0.0, &values, &mut rates);
                    }
                });
                assert_eq!(used.count_total, 0, "{law:?} {control:?}");
            }
        }
    }
}

#[test]
fn a_run_with_4096_radii_stays_below_100_megabytes() {
    for method in ["simplified", "exact"] {
        let request = json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N", "held": "depth"},
            "motion": {"stick_ratio": 0.5},
            "cycles": {"normalized": [0.5, 1, 2, 4, 8, 16]},
            "model": {"method": method, "points": 4096},
        });
        let most = measure(|| {
            let (scenario, _) = scenario::check(&request, "").expect("a valid scenario");
            let outcome = Simulation::of(&scenario).expect("a contact").run();
            assert_eq!(outcome.profiles.expect("profiles").radius.len(), 4096);
        })
        .bytes_max;
        println!("{method}: at most {:.1} MB", most as f64 / 1e6);
        assert!((1_000_000..100_000_000).contains(&most), "{most} bytes");
    }
}
