//! Measures the time of a fit on two threads: five tests, two parameters, eight starts. It prints the time until the
//! estimates are known, the time of everything, and the number of runs.

#![expect(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark prints its results, and may panic"
)]

use std::iter;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;

use fretwork_study::{Kind, Points, Rows, Study};
use serde_json::Value;

const THREADS: usize = 2;
const ROUNDS: usize = 5;

/// The rows of these points, which belong to one stage.
fn stage(study: &Arc<Study>, points: std::ops::Range<usize>, earlier: &Rows) -> Rows {
    let next = AtomicUsize::new(points.start);
    let work = || {
        let numbers = iter::repeat_with(|| next.fetch_add(1, Ordering::Relaxed));
        let own = numbers.take_while(|number| *number < points.end).map(|number| {
            let mut point =
                Points::chunk(Arc::clone(study), number, study.points(), earlier.clone());
            (number, iter::repeat_with(|| point.step()).find_map(|rows| rows).expect("a row"))
        });
        own.collect::<Vec<_>>()
    };
    let mut rows: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("no panic")).collect()
    });
    rows.sort_by_key(|(number, _)| *number);
    let mut all = earlier.clone();
    for (_, rows) in rows {
        all.append(rows);
    }
    all
}

fn main() {
    let body: Value = serde_json::from_str(include_str!("../../../examples/studies/fit.json"))
        .expect("the example is JSON");
    let kind = Kind::named("fit").expect("there are fits");
    for _ in 0..ROUNDS {
        let study = Arc::new(Study::read(kind, body["fit"].clone()).expect("the example is valid"));
        let (start, mut rows, mut times) = (Instant::now(), Rows::default(), Vec::new());
        let ends = study.stages().into_iter().chain([study.points()]);
        for end in ends {
            rows = stage(&study, rows.count..end, &rows);
            times.push(start.elapsed().as_secs_f64());
        }
        let text = study.document(&"key", &"engine", rows);
        let found: Value = serde_json::from_str(&text).expect("the document is JSON");
        // The second stage ends with the estimates.
        println!(
            "estimates {:.2} s, everything {:.2} s, {} runs",
            times[1],
            start.elapsed().as_secs_f64(),
            found["quality"]["runs"]
        );
    }
}
