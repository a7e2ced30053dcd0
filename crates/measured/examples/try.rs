use fretwork_measured::{Prepare, Up, Wanted, read};
fn main() {
    let mut scar = None;
    let mut up = None;
    for arg in std::env::args().skip(1) {
        if let Some(x) = arg.strip_prefix("scar=") {
            let (a, b) = x.split_once("..").unwrap();
            scar = Some([a.parse::<f64>().unwrap() * 1e-6, b.parse::<f64>().unwrap() * 1e-6]);
            continue;
        }
        if arg == "up=in" {
            up = Some(Up::In);
            continue;
        }
        let wanted = Wanted {
            x: None,
            y: None,
            prepare: Prepare::Trace,
            level: true,
            centre: true,
            up,
            scar,
        };
        println!("== {arg}");
        match read(&std::fs::read(&arg).unwrap(), &wanted) {
            Ok(m) => {
                for n in &m.notes {
                    println!("  {n}");
                }
                println!("  {}", m.prepared["trace"]);
                println!("  indenter {}", !m.prepared["indenter"].is_null());
            }
            Err(f) => println!("  REFUSED {}", f.0[0].detail),
        }
    }
}
