//! Line contacts: closed forms, converged runs of another code, boundary elements, and the balance of energy.

use fretwork_engine::contact::control::{self, Control, Normal};
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::reference::Series;
use fretwork_engine::contact::unworn::Contact;
use fretwork_engine::numeric::integrate;
use fretwork_engine::solver::curves::Curves;
use fretwork_engine::solver::stepped::march::{March, MarchState};

use crate::exact_problem;
use crate::plane_elements::{Contact as Elements, Held, State};

/// A reference at the distance `reach` without a rig.
fn points_at(reach: f64) -> Series {
    Series { reach, compliance: 0.0 }
}

fn held(held: control::Held, contact: &Contact) -> Control {
    Control::constant(Normal::Depth, held, contact.threshold)
}

/// The stroke of an unworn contact in μh₀, by another quadrature than that of the engine.
fn stroke(contact: &Contact, reach: f64) -> f64 {
    let (from, theta) = (contact.stick.max(1e-9), contact.threshold);
    let missing = |s: f64| (theta - 1.0 + contact.shape.image(s)).max(0.0);
    // s = reach·sin φ removes the root at the points of the reference.
    let of_angle = |phi: f64| {
        let s = reach * libm::sin(phi);
        (if s < 1.0 { missing(s) } else { theta }) / libm::sin(phi)
    };
    let angle = |s: f64| libm::asin(s / reach);
    let pieces = |from: f64, to: f64| -> f64 {
        let width = (to - from) / 200.0;
        (0..200)
            .map(|i| from + width * f64::from(i))
            .map(|x| integrate(x, x + width, of_angle))
            .sum()
    };
    let kink = contact.shape.kinks().first().copied().unwrap_or(from).max(from);
    pieces(angle(from), angle(kink)) + pieces(angle(kink), angle(1.0)) + theta * libm::acosh(reach)
}

fn at(run: &mut March, time: f64) -> MarchState {
    while run.advance(time) {}
    run.at(time)
}

fn started(contact: &Contact, control: &Control, last: f64) -> March {
    March::new(exact_problem(contact, control), 3e-3, last).expect("a scar that fits")
}

/// The table of V at Ñ with both forces held, by a prototype with another code on 200 cells.
#[test]
fn volumes_with_both_forces_held_agree_with_converged_runs() {
    for (c, volumes) in [
        (0.5, [0.066_046, 0.139_656, 0.369_867, 0.580_010, 0.632_352, 0.633_904]),
        (0.7, [0.015_971, 0.032_991, 0.084_021, 0.137_170, 0.154_123, 0.154_810]),
    ] {
        let contact = Contact::sticking(Shape::line_power(2.0), c).expect("a limit");
        let control = held(control::Held::Threshold, &contact);
        let mut run = started(&contact, &control, 50.0);
        for (time, known) in [1.0, 2.0, 5.0, 10.0, 20.0, 50.0].into_iter().zip(volumes) {
            let MarchState { worn, errors, .. } = at(&mut run, time);
            let error = (worn.volume / known - 1.0).abs();
            assert!(error < 1e-3 && error < errors.volume, "{c} {time}: {error}");
            assert_eq!(worn.stick, contact.stick);
        }
    }
}

/// The same with the stroke held against points of the surface. The table is right to about 1 %.
#[test]
fn volumes_with_a_stroke_held_agree_with_converged_runs() {
    for (reach, volumes, stick, force) in [
        (10.0, [0.06431, 0.33543, 0.58063, 0.58295], 0.514, 0.892),
        (1000.0, [0.06526, 0.35381, 0.60737, 0.60921], 0.507, 0.950),
    ] {
        let contact = Contact::sticking(Shape::line_power(2.0), 0.5).expect("a limit");
        let contact = Contact { reference: Some(points_at(reach)), ..contact };
        let control = held(control::Held::Stroke(stroke(&contact, reach)), &contact);
        let mut run = started(&contact, &control, 50.0);
        for (time, known) in [1.0, 5.0, 20.0, 50.0].into_iter().zip(volumes) {
            let error = (at(&mut run, time).worn.volume / known - 1.0).abs();
            assert!(error < 1e-2, "{reach} {time}: {error}");
        }
        let worn = run.at(50.0).worn;
        assert!((worn.stick - stick).abs() < 2e-3, "{reach}: {}", worn.stick);
        assert!((worn.threshold / 0.75 - force).abs() < 2e-3, "{reach}: {}", worn.threshold);
    }
}

/// W/(8μ²F²/(πE*)) = (1 − c⁴)/4 + c² ln c, in units of 4μ²Fh₀.
#[test]
fn the_energy_of_an_unworn_cylinder_is_that_of_its_closed_form() {
    use fretwork_engine::contact::row::UnwornSums;
    for c in [0.05_f64, 0.2, 0.5, 0.8, 0.99] {
        let contact = Contact::sticking(Shape::line_power(2.0), c).expect("a limit");
        let closed = if c > 0.98 {
            // To third order in 1 − c², where the terms cancel.
            let q = 1.0 - c * c;
            q * q * q / 12.0 * (1.0 + 0.5 * q + 0.3 * q * q + 0.2 * q * q * q)
        } else {
            (1.0 - libm::pow(c, 4.0)) / 4.0 + c * c * libm::log(c)
        };
        let found = UnwornSums::of(&contact, None).loss * contact.threshold;
        assert!((found / closed - 1.0).abs() < 1e-6, "{c}: {found} {closed}");
    }
}

/// The state of the engine as boundary elements find it: E* = 2/π, F = a₀ = h₀ = 1.
struct Compared {
    pressure: f64,
    path: f64,
    energy: f64,
    aperture: f64,
}

const FRICTION: f64 = 0.6;

fn compare(
    (contact, run): (&Contact, &mut March),
    time: f64,
    (hold, elements): (impl Fn(&MarchState) -> Held, usize),
) -> Compared {
    let state = at(run, time);
    let worn = &state.worn;
    let (shape, places, wear) = (contact.shape.clone(), worn.places.clone(), worn.wear.clone());
    let gap = move |x: f64| {
        let right = places.partition_point(|place| *place <= x);
        let wear = match right {
            0 => wear[0],
            _ if right == places.len() => wear[right - 1],
            _ => {
                let share = (x - places[right - 1]) / (places[right] - places[right - 1]);
                wear[right - 1] + share * (wear[right] - wear[right - 1])
            }
        };
        shape.profile(x) + wear
    };
    let kinks = [contact.shape.kinks(), &[worn.stick, worn.scar]].concat();
    let elements = Elements {
        gap: Box::new(gap),
        kinks: kinks.into_iter().filter(|x| *x > 0.0).collect(),
        bound: 1.3 * worn.contact_radius + 0.1,
        force: 1.0,
        friction: FRICTION,
        modulus: std::f64::consts::FRAC_2_PI,
    }
    .solve(hold(&state), elements);
    let State { centres, widths, pressure, path, energy, aperture, .. } = elements;
    let surface = run.wearing().surface();
    let curves = Curves::of(&contact.shape, surface, worn, &centres);
    let slip = 4.0 * FRICTION * worn.threshold;
    // Root mean squares over the ring that slips, weighted by the pressure.
    let (mut apart, mut far, mut load, mut most) = (0.0, 0.0, 0.0, 0.0_f64);
    for i in 0..centres.len() {
        if centres[i] < worn.stick || centres[i] > worn.contact_radius {
            continue;
        }
        let weight = widths[i];
        apart += weight * (curves.pressure[i].min(1e3) - pressure[i]).powi(2);
        far += weight * pressure[i] * (slip * curves.slip[i] - path[i]).powi(2);
        load += weight * pressure[i];
        most = most.max(path[i]);
    }
    let ring = worn.contact_radius - worn.stick;
    let mean = 0.5 / worn.contact_radius;
    let found = 4.0 * FRICTION * FRICTION * worn.loss * worn.threshold;
    Compared {
        pressure: (apart / ring).sqrt() / mean,
        path: (far / load).sqrt() / most,
        energy: (found / energy - 1.0).abs(),
        aperture: aperture / FRICTION,
    }
}

#[test]
fn boundary_elements_find_the_pressure_and_the_slip_of_worn_contacts() {
    const REACH: f64 = 12.0;
    for shape in [Shape::line_power(2.0), Shape::line_power(1.0), Shape::punch(0.5)] {
        let reference = Some(points_at(REACH));
        let partial = Contact::sticking(shape.clone(), 0.6).expect("a limit");
        let whole = Contact::new(shape.clone(), 1.0).expect("scales");
        let [partial, whole] = [partial, whole].map(|contact| Contact { reference, ..contact });
        let (stick, slide) = (stroke(&partial, REACH), 4.0 * stroke(&whole, REACH));
        let of_stroke = |amplitude: f64| {
            move |_: &MarchState| Held::Stroke {
                amplitude: FRICTION * amplitude,
                reference: REACH,
                rig_stiffness: None,
            }
        };
        let force = |state: &MarchState| Held::Force(FRICTION * state.worn.threshold);
        for time in [1e-6, 1.0, 3.0] {
            let short = time / slide;
            let found = [60, 120].map(|elements| {
                let mut run = started(&partial, &held(control::Held::Threshold, &partial), time);
                let by_force = compare((&partial, &mut run), time, (force, elements));
                let mut run =
                    started(&partial, &held(control::Held::Stroke(stick), &partial), time);
                let by_stroke = compare((&partial, &mut run), time, (of_stroke(stick), elements));
                let mut run = started(&whole, &held(control::Held::Stroke(slide), &whole), short);
                [
                    by_force,
                    by_stroke,
                    compare((&whole, &mut run), short, (of_stroke(slide), elements)),
                ]
            });
            let [coarse, fine] = found;
            for (held, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
                let name = format!("{shape:?} {held} {time}");
                assert!(coarse.path < 5e-4 && fine.path < 2.5e-4, "{name}: {}", fine.path);
                assert!(fine.path < 0.7 * coarse.path || fine.path < 2e-5, "{name}: {}", fine.path);
                assert!(fine.energy < 7e-4, "{name}: {}", fine.energy);
                // The sharp tip of an unworn wedge carries an infinite pressure.
                let is_sharp = shape.peak_pressure().is_infinite() && held == 2 && time < 0.1;
                assert!(
                    fine.pressure < if is_sharp { 0.06 } else { 0.04 },
                    "{name}: {}",
                    fine.pressure
                );
            }
        }
    }
}

/// A loop of the given aperture has this aperture in boundary elements, and the same energy and slip.
#[test]
fn boundary_elements_find_the_held_aperture_of_worn_contacts() {
    const REACH: f64 = 12.0;
    for shape in [Shape::line_power(2.0), Shape::line_power(1.0), Shape::punch(0.5)] {
        for aperture in [0.05, 2.0] {
            let series = points_at(REACH);
            let (threshold, _) = series.at_aperture(&shape, aperture);
            let contact = Contact::new(shape.clone(), threshold).expect("scales");
            let contact = Contact { reference: Some(series), ..contact };
            let control = held(control::Held::Aperture(aperture), &contact);
            for time in [1e-6, 0.3, 1.0] {
                let mut run = started(&contact, &control, time);
                let of_stroke = |state: &MarchState| Held::Stroke {
                    amplitude: FRICTION * state.worn.stroke,
                    reference: REACH,
                    rig_stiffness: None,
                };
                let found = compare((&contact, &mut run), time, (of_stroke, 120));
                let name = format!("{shape:?} {aperture} {time}");
                let apart = (found.aperture / aperture - 1.0).abs();
                assert!(apart < 2e-3 && found.energy < 2e-3, "{name}: {apart} {}", found.energy);
                assert!(found.path < 5e-4, "{name}: {}", found.path);
                assert!(found.pressure < 0.06, "{name}: {}", found.pressure);
            }
        }
    }
}

/// A table, a power law and a cylinder of the same profile give the same run.
#[test]
fn a_measured_cylinder_wears_like_a_cylinder() {
    use fretwork_engine::scenario;
    use fretwork_engine::simulation::Simulation;
    use serde_json::{Value, json};
    let radius = 6e-3;
    let x: Vec<f64> = (0..=60).map(|i| 2.5e-6 * f64::from(i)).collect();
    let z: Vec<f64> = x.iter().map(|x| x * x / (2.0 * radius)).collect();
    for motion in [
        json!({"stick_ratio": 0.5}),
        json!({"amplitude": "0.3 um", "reference_distance": "5 mm", "rig_stiffness": "400 N/um"}),
        json!({"amplitude": "0.4 um", "loop_stiffness": "200 N/um"}),
        json!({"sliding_amplitude": "5 um"}),
        json!({"blocks": [{"tangential_force": "4 N/mm", "cycles": 2e4},
                          {"tangential_force": "6 N/mm", "cycles": 1e6}]}),
        json!({"blocks": [{"amplitude": "0.15 um", "cycles": 2e4}, {"amplitude": "3 um", "cycles": 1e6}],
               "reference_distance": "5 mm"}),
    ] {
        let run = |profile: Value| {
            let request = json!({
                "profile": profile, "moduli": {"normal": "110 GPa"}, "friction": 0.6,
                "wear": {"coefficient": 1e-15}, "load": {"normal_force": "18.5 N/mm"},
                "motion": motion, "cycles": [1e3, 1e4, 1e5],
            });
            let (scenario, _) =
                scenario::check(&request, "").unwrap_or_else(|faults| panic!("{faults:?}"));
            Simulation::of(&scenario).expect("a contact").run()
        };
        let cylinder = run(json!({"shape": "cylinder", "radius": radius, "length": "10 mm"}));
        let power =
            run(json!({"shape": "power", "geometry": "line", "length": "10 mm", "exponent": 2,
                               "height": 0.5 * radius, "at_radius": radius}));
        let table = run(
            json!({"shape": "table", "geometry": "line", "length": "10 mm", "radius": x, "height": z}),
        );
        for other in [&power, &table] {
            for (name, column) in cylinder.history.columns() {
                let (_, again) =
                    other.history.columns().into_iter().find(|it| it.0 == name).expect(name);
                if name.ends_with("_error") {
                    continue;
                }
                for (a, b) in column.iter().zip(again) {
                    let same = (a - b).abs() <= 3e-3 * a.abs() || a.is_nan() && b.is_nan();
                    assert!(same, "{motion} {name}: {column:?} {again:?}");
                }
            }
        }
        let mismatch = cylinder.accuracy.energy_mismatch.expect("wear");
        assert!(mismatch.abs() < 1e-3, "{motion}: {mismatch}");
    }
}
