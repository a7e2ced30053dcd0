//! Refused requests: each gets the right problem with all its faults, and the server keeps running.

use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use crate::server::{JSON, Server, answer, steel_ball};

/// A request and the expected answer.
struct Case {
    name: &'static str,
    method: &'static str,
    target: String,
    content_type: Option<&'static str>,
    body: Vec<u8>,
    status: u16,
    slug: &'static str,
    /// The pointers or parameters of all faults.
    places: Vec<&'static str>,
    /// Words that the text of at least one fault contains.
    says: &'static str,
}

fn case(
    name: &'static str,
    method: &'static str,
    target: &str,
    status: u16,
    slug: &'static str,
) -> Case {
    let content_type = (method == "POST").then_some(JSON.1);
    let target = target.to_owned();
    Case {
        name,
        method,
        target,
        content_type,
        body: vec![],
        status,
        slug,
        places: vec![],
        says: "",
    }
}

/// A body that is not valid JSON.
fn text(name: &'static str, body: impl Into<Vec<u8>>) -> Case {
    Case { body: body.into(), ..case(name, "POST", "/v1/jobs", 400, "invalid-json") }
}

/// The steel ball with some values replaced. The faults are expected at `places`.
fn ball<const N: usize>(
    name: &'static str,
    set: &[(&str, Value)],
    places: [&'static str; N],
) -> Case {
    let mut body = steel_ball();
    for (pointer, value) in set {
        let (parent, member) = pointer.rsplit_once('/').unwrap();
        let parent = body.pointer_mut(parent).unwrap();
        match parent {
            Value::Array(items) => items[member.parse::<usize>().unwrap()] = value.clone(),
            parent => parent[member] = value.clone(),
        }
    }
    faulty(name, &body.to_string(), places)
}

fn faulty<const N: usize>(name: &'static str, body: &str, places: [&'static str; N]) -> Case {
    Case {
        body: body.into(),
        places: places.to_vec(),
        ..case(name, "POST", "/v1/jobs", 422, "invalid-request")
    }
}

/// The steel ball with some members of its scenario replaced. It has one fault, at `place`, whose
/// text contains `says`.
fn one_fault(name: &'static str, set: Value, place: &'static str, says: &'static str) -> Case {
    let mut body = steel_ball();
    let Value::Object(set) = set else { panic!("{name}: no object") };
    for (member, value) in set {
        body["scenario"][member] = value;
    }
    Case { says, ..faulty(name, &body.to_string(), [place]) }
}

/// A query with a fault in one parameter.
fn query(name: &'static str, target: &str, parameter: &'static str) -> Case {
    Case { places: vec![parameter], ..case(name, "GET", target, 422, "invalid-parameters") }
}

const ID: &str = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11";
const KEY: &str = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";

async fn all_are_refused(cases: Vec<Case>) {
    let server = Server::start().await;
    let mut failures = Vec::new();
    for case in cases {
        let headers: Vec<_> = case.content_type.map(|kind| (JSON.0, kind)).into_iter().collect();
        let reply = server.send(case.method, &case.target, &headers, &case.body).await;
        if reply.status != case.status {
            let shown = String::from_utf8_lossy(&reply.body).chars().take(300).collect::<String>();
            failures.push(format!("{}: {} {shown}", case.name, reply.status));
            continue;
        }
        let problem = reply.problem(case.status, case.slug);
        let mut expected = case.places;
        expected.sort_unstable();
        let mut places: Vec<&str> = problem["errors"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|error| error["pointer"].as_str().or(error["parameter"].as_str()).unwrap())
            .collect();
        places.sort_unstable();
        if places != expected {
            failures.push(format!("{}: {places:?}, expected {expected:?}", case.name));
        }
        let mut details = problem["errors"].as_array().into_iter().flatten();
        if !case.says.is_empty()
            && !details.any(|error| error["detail"].as_str().unwrap().contains(case.says))
        {
            failures.push(format!("{}: no {:?} in {problem}", case.name, case.says));
        }
        assert_eq!(server.get("/healthz").await.status, 200, "after {}", case.name);
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_json_and_unknown_paths_are_refused() {
    let oversized = format!("{{\"label\": \"{}\"}}", "x".repeat(5 << 20));
    let deep = "[".repeat(100_000);
    all_are_refused(vec![
        text("empty body", ""),
        text("blank body", " \n"),
        text("truncated", r#"{"scenario": {"#),
        text("trailing comma", r#"{"scenario": {},}"#),
        text("NaN literal", r#"{"scenario": {"friction": NaN}}"#),
        text("infinite literal", r#"{"scenario": {"friction": Infinity}}"#),
        text("number too large", r#"{"scenario": {"friction": 1e999}}"#),
        text("not UTF-8", b"{\"label\": \"\xff\"}".to_vec()),
        text("two documents", "{} {}"),
        Case { status: 413, slug: "body-too-large", ..text("deep nesting", deep) },
        text("YAML", "scenario:\n  friction: 0.7"),
        Case { status: 413, slug: "body-too-large", ..text("oversized body", oversized) },
        Case {
            content_type: Some("application/x-www-form-urlencoded"),
            status: 415,
            slug: "unsupported-media-type",
            ..text("form", "scenario=steel")
        },
        Case {
            content_type: Some("text/plain"),
            status: 415,
            slug: "unsupported-media-type",
            ..text("plain text", steel_ball().to_string())
        },
        Case {
            content_type: None,
            status: 415,
            slug: "unsupported-media-type",
            ..text("no type", steel_ball().to_string())
        },
        case("unknown path", "GET", "/v2/jobs", 404, "not-found"),
        case("slash at the end", "GET", "/v1/jobs/", 404, "not-found"),
        case("wrong method", "DELETE", "/v1/jobs", 405, "method-not-allowed"),
        case(
            "wrong method on a result",
            "PUT",
            &format!("/v1/results/{KEY}"),
            405,
            "method-not-allowed",
        ),
        case("GET of a check", "GET", "/v1/scenarios", 405, "method-not-allowed"),
        case("bad id", "GET", "/v1/jobs/42", 404, "not-found"),
        case("unknown id", "GET", &format!("/v1/jobs/{ID}"), 404, "not-found"),
        case("path that is not UTF-8", "GET", "/v1/jobs/%FF", 404, "not-found"),
        case("bad key", "GET", "/v1/results/XYZ", 404, "unknown-result"),
        case("unknown key", "GET", &format!("/v1/results/{KEY}"), 404, "unknown-result"),
        case(
            "history of an unknown key",
            "GET",
            &format!("/v1/results/{KEY}/history"),
            404,
            "unknown-result",
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_invalid_query_is_refused_with_the_parameter_name() {
    all_are_refused(vec![
        query("unknown parameter", "/v1/jobs?lmit=5", "lmit"),
        query("bad state", "/v1/jobs?state=done", "state"),
        query("bad limit", "/v1/jobs?limit=0", "limit"),
        query("large limit", "/v1/jobs?limit=100000", "limit"),
        query("bad cursor", "/v1/jobs?cursor=first", "cursor"),
        query("bad key filter", "/v1/jobs?key=abc", "key"),
        query("owner without a name", "/v1/jobs?owner=", "owner"),
        query("repeated parameter", "/v1/jobs?limit=1&limit=2", "limit"),
        query("bad wait", &format!("/v1/jobs/{ID}?wait=soon"), "wait"),
        query("long wait", &format!("/v1/jobs/{ID}?wait=3600"), "wait"),
        query("bad include", &format!("/v1/jobs/{ID}?include=everything"), "include"),
        query("bad format", &format!("/v1/results/{KEY}?format=xml"), "format"),
        query("parameter on a route without parameters", "/healthz?verbose=1", "verbose"),
        Case {
            places: vec!["limit", "sort", "state"],
            ..query("three faults", "/v1/jobs?sort=up&limit=x&state=y", "")
        },
        Case {
            body: steel_ball().to_string().into(),
            method: "POST",
            content_type: Some(JSON.1),
            ..query("bad include of a submission", "/v1/jobs?include=all", "include")
        },
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn structure_and_unit_faults_are_reported_with_pointers() {
    all_are_refused(vec![
        faulty("not an object", "[]", [""]),
        faulty("no scenario", "{}", ["/scenario"]),
        faulty("scenario of the wrong type", r#"{"scenario": 7}"#, ["/scenario"]),
        ball("unknown member of the job", &[("/lable", json!("x"))], ["/lable"]),
        ball("unknown member", &[("/scenario/frictoin", json!(0.7))], ["/scenario/frictoin"]),
        ball(
            "unknown member of the load",
            &[("/scenario/load/helt", json!("depth"))],
            ["/scenario/load/helt"],
        ),
        ball("label of the wrong type", &[("/label", json!(7))], ["/label"]),
        ball("tags of the wrong type", &[("/tags", json!("steel"))], ["/tags"]),
        ball(
            "friction of the wrong type",
            &[("/scenario/friction", json!([]))],
            ["/scenario/friction"],
        ),
        ball(
            "unknown unit",
            &[("/scenario/profile/radius", json!("10 furlongs"))],
            ["/scenario/profile/radius"],
        ),
        ball(
            "wrong dimension",
            &[("/scenario/profile/radius", json!("10 kg"))],
            ["/scenario/profile/radius"],
        ),
        ball(
            "force in metres",
            &[("/scenario/load/normal_force", json!("100 mm"))],
            ["/scenario/load/normal_force"],
        ),
        ball(
            "negative radius",
            &[("/scenario/profile/radius", json!(-0.01))],
            ["/scenario/profile/radius"],
        ),
        ball(
            "no radius",
            &[("/scenario/profile", json!({"shape": "sphere"}))],
            ["/scenario/profile/radius"],
        ),
        ball(
            "unknown shape",
            &[("/scenario/profile/shape", json!("cube"))],
            ["/scenario/profile/shape"],
        ),
        faulty(
            "repeated member",
            &steel_ball().to_string().replace("\"friction\":", "\"friction\":0.1,\"friction\":"),
            ["/scenario/friction"],
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn values_out_of_range_are_reported_with_pointers() {
    let model = "/scenario/model/points";
    let poisson = "/scenario/bodies/0/poisson_ratio";
    all_are_refused(vec![
        ball("Poisson ratio of 0.7", &[(poisson, json!(0.7))], [poisson]),
        ball("negative friction", &[("/scenario/friction", json!(-0.7))], ["/scenario/friction"]),
        ball("three bodies", &[("/scenario/bodies", json!([{}, {}, {}]))], ["/scenario/bodies"]),
        ball("no points", &[(model, json!(0))], [model]),
        ball("a thousand million points", &[(model, json!(1_000_000_000))], [model]),
        ball("fractional points", &[(model, json!(64.5))], [model]),
        ball(
            "many output cycles",
            &[("/scenario/cycles", json!(vec![1; 200_000]))],
            ["/scenario/cycles"],
        ),
        ball("unsorted cycles", &[("/scenario/cycles", json!([3, 1]))], ["/scenario/cycles/1"]),
        ball("no cycles", &[("/scenario/cycles", json!([]))], ["/scenario/cycles"]),
        ball("negative cycles", &[("/scenario/cycles", json!([-1, 1]))], ["/scenario/cycles/0"]),
        ball(
            "unsorted energies",
            &[("/scenario/cycles", json!({"dissipated_energy": ["1 J", "10 mJ"]}))],
            ["/scenario/cycles/dissipated_energy/1"],
        ),
        ball(
            "energies of 0, in newtons, and too large",
            &[("/scenario/cycles", json!({"dissipated_energy": [0, "1 N", 1e19]}))],
            [
                "/scenario/cycles/dissipated_energy/0",
                "/scenario/cycles/dissipated_energy/1",
                "/scenario/cycles/dissipated_energy/2",
            ],
        ),
        ball(
            "profiles at listed energies",
            &[
                ("/scenario/cycles", json!({"dissipated_energy": [1]})),
                ("/scenario/profiles_at", json!([1])),
            ],
            ["/scenario/profiles_at"],
        ),
        ball(
            "zero amplitude",
            &[("/scenario/motion/amplitude", json!(0))],
            ["/scenario/motion/amplitude"],
        ),
        ball(
            "unknown method",
            &[("/scenario/model/method", json!("guess"))],
            ["/scenario/model/method"],
        ),
        ball(
            "four faults",
            &[
                ("/scenario/profile/radius", json!("10 kg")),
                (poisson, json!(0.7)),
                ("/scenario/friction", json!("slippery")),
                ("/scenario/frictoin", json!(0.7)),
            ],
            [poisson, "/scenario/frictoin", "/scenario/friction", "/scenario/profile/radius"],
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn shape_faults_are_reported_with_pointers() {
    all_are_refused(vec![
        ball(
            "flat without a radius",
            &[("/scenario/profile", json!({"shape": "truncated_cone", "slope_angle": 0.1}))],
            ["/scenario/profile/flat_radius"],
        ),
        ball(
            "height with a unit of mass",
            &[(
                "/scenario/profile",
                json!({"shape": "table", "radius": [0, 2e-4, 1e-4], "height": [0, 1e-6, "1 kg"]}),
            )],
            ["/scenario/profile/height/2"],
        ),
        ball(
            "table with two bad rows",
            &[(
                "/scenario/profile",
                json!({"shape": "table", "radius": [0, 2e-4, 1e-4], "height": [0, 1e-6, -1e-6]}),
            )],
            ["/scenario/profile/radius/2", "/scenario/profile/height/2"],
        ),
        ball(
            "table narrower than the contact",
            &[(
                "/scenario/profile",
                json!({"shape": "table", "radius": [0, 1e-6, 2e-6], "height": [0, 1e-9, 4e-9]}),
            )],
            ["/scenario/profile/radius/2"],
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn load_and_motion_faults_are_reported_with_pointers() {
    let load = |load: Value| json!({"load": load});
    let motion = |motion: Value| json!({"motion": motion});
    let force = "/scenario/load/normal_force";
    let tangential = "/scenario/motion/tangential_force";
    let amplitude = "/scenario/motion/amplitude";
    all_are_refused(vec![
        one_fault(
            "force and depth",
            load(json!({"normal_force": 100, "indentation_depth": 3e-6})),
            force,
            "not both",
        ),
        one_fault("neither force nor depth", load(json!({"held": "force"})), force, "is missing"),
        one_fault(
            "pressure held",
            load(json!({"normal_force": 100, "held": "pressure"})),
            "/scenario/load/held",
            "depth, force",
        ),
        one_fault("no motion", motion(json!({})), amplitude, "is missing"),
        one_fault(
            "amplitude and force",
            motion(json!({"amplitude": 2e-6, "tangential_force": 40})),
            tangential,
            "combined with `amplitude`",
        ),
        one_fault("Q = μF", motion(json!({"tangential_force": "70 N"})), tangential, "at most μF"),
        one_fault("Q > μF", motion(json!({"tangential_force": "1 kN"})), tangential, "at most μF"),
        one_fault(
            "force in metres",
            motion(json!({"tangential_force": "1 um"})),
            tangential,
            "the unit of a length",
        ),
        one_fault(
            "Q held in gross slip",
            motion(json!({"amplitude": "4 um", "held": "tangential_force"})),
            amplitude,
            "hold the amplitude",
        ),
        one_fault(
            "Q held at the onset",
            motion(json!({"stick_ratio": 0, "held": "tangential_force"})),
            "/scenario/motion/stick_ratio",
            "hold the amplitude",
        ),
        one_fault(
            "thin ring under a held force",
            json!({
                "load": {"normal_force": 100, "held": "force"}, "motion": {"amplitude": "0.2 nm"}
            }),
            amplitude,
            "slip ring",
        ),
        one_fault(
            "unbounded wear scar",
            json!({
                "load": {"normal_force": 100, "held": "force"},
                "motion": {"amplitude": "10 um"}, "cycles": [1e14],
            }),
            "/scenario/cycles",
            "fewer cycles",
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn rig_faults_are_reported_with_pointers() {
    let motion = |motion: Value| json!({"motion": motion});
    let rig = "/scenario/motion/rig_stiffness";
    all_are_refused(vec![
        one_fault(
            "rig with Q held",
            motion(json!({"tangential_force": 40, "rig_stiffness": 1e7})),
            rig,
            "no effect",
        ),
        one_fault(
            "stiffness in newtons",
            motion(json!({"amplitude": 2e-6, "rig_stiffness": "10 N"})),
            rig,
            "N/um",
        ),
        one_fault(
            "zero stiffness",
            motion(json!({"amplitude": 2e-6, "rig_stiffness": 0})),
            rig,
            "greater than 0",
        ),
        one_fault(
            "rig softer than the contact",
            motion(json!({"stick_ratio": 0.5, "rig_stiffness": 1e-6})),
            rig,
            "stiffer",
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn block_faults_are_reported_with_pointers() {
    let block = |amplitude: Value, cycles: f64| json!({"amplitude": amplitude, "cycles": cycles});
    let block_2um = || block(json!("2 um"), 1e5);
    let blocks = |blocks: &[Value]| json!({"motion": {"blocks": blocks}});
    let with = |member: &str, value: Value| json!({"motion": {"blocks": [block(json!("2 um"), 1e5)], (member): value}});
    let motion = "/scenario/motion/blocks";
    let reversals_pointer = "/scenario/motion/reversals";
    let rig = "/scenario/motion/rig_stiffness";
    let normalized = "/scenario/cycles/normalized";
    all_are_refused(vec![
        one_fault("amplitude with blocks", with("amplitude", json!(2e-6)), motion, "combined with"),
        one_fault(
            "reversals with blocks",
            with("reversals", json!([0, 1e-6])),
            reversals_pointer,
            "combined with",
        ),
        one_fault("rig with blocks", with("rig_stiffness", json!(1e7)), rig, "at the contact"),
        one_fault(
            "blocks with Q held",
            with("held", json!("tangential_force")),
            "/scenario/motion/held",
            "must be \"amplitude\"",
        ),
        one_fault("no blocks", blocks(&[]), motion, "1 to 1000"),
        one_fault("too many blocks", blocks(&vec![block_2um(); 1001]), motion, "1 to 1000"),
        one_fault(
            "rest in the first block",
            blocks(&[block(json!(0), 1e4), block_2um()]),
            "/scenario/motion/blocks/0/amplitude",
            "in the first block",
        ),
        one_fault(
            "tiny amplitude of a block",
            blocks(&[block_2um(), block(json!(1e-12), 1e4)]),
            "/scenario/motion/blocks/1/amplitude",
            "slip ring",
        ),
        one_fault(
            "negative amplitude",
            blocks(&[block_2um(), block(json!("-2 um"), 1e4)]),
            "/scenario/motion/blocks/1/amplitude",
            "between",
        ),
        one_fault(
            "block without cycles",
            blocks(&[block(json!(2e-6), 0.0)]),
            "/scenario/motion/blocks/0/cycles",
            "greater than 0",
        ),
        one_fault(
            "output cycle after the last block",
            blocks(&[block(json!("2 um"), 1e4), block(json!("1 um"), 1e4)]),
            "/scenario/cycles/3",
            "the last block ends at 20000",
        ),
        one_fault(
            "normalized cycles of blocks",
            json!({"motion": {"blocks": [block_2um()]}, "cycles": {"normalized": [1]}}),
            normalized,
            "`blocks`",
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn reversal_faults_are_reported_with_pointers() {
    let reversals = |reversals: Value| json!({"motion": {"reversals": reversals}});
    let pointer = "/scenario/motion/reversals";
    let rig = "/scenario/motion/rig_stiffness";
    let normalized = "/scenario/cycles/normalized";
    all_are_refused(vec![
        one_fault(
            "normalized cycles of reversals",
            json!({"motion": {"reversals": [-2e-6, 2e-6]}, "cycles": {"normalized": [1]}}),
            normalized,
            "`reversals`",
        ),
        one_fault(
            "equal reversals",
            reversals(json!(["1 um", 1e-6, "1000 nm"])),
            pointer,
            "the same",
        ),
        one_fault("one reversal", reversals(json!(["1 um"])), pointer, "2 to 100000"),
        one_fault(
            "reversal in seconds",
            reversals(json!(["1 um", "1 s"])),
            "/scenario/motion/reversals/1",
            "unknown unit",
        ),
        one_fault(
            "rig with reversals",
            json!({"motion": {"reversals": [-2e-6, 2e-6], "rig_stiffness": 1e7}}),
            rig,
            "at the contact",
        ),
    ])
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn stop_condition_and_table_faults_are_reported_with_pointers() {
    let until = |until: Value| json!({"until": until});
    let profile = |profile: Value| json!({"profile": profile});
    let flat = json!({"shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": "20 mm"});
    let table = |radius: Value, height: Value| {
        profile(json!({"shape": "table", "radius": radius, "height": height}))
    };
    let share = |share: Value| json!({"wear": {"coefficient": 3e-14, "share": share}});
    let compare = |compare: Value| json!({"model": {"method": "exact", "compare": compare}});
    let depth = "/scenario/until/wear_depth";
    let volume = "/scenario/until/wear_volume";
    all_are_refused(vec![
        one_fault("empty stop condition", until(json!({})), depth, "is missing"),
        one_fault(
            "two stop conditions",
            until(json!({"wear_depth": 1e-6, "wear_volume": 1e-12})),
            volume,
            "only one",
        ),
        one_fault(
            "energy in watts",
            until(json!({"dissipated_energy": "1 W"})),
            "/scenario/until/dissipated_energy",
            "Accepted units: J, kJ",
        ),
        one_fault("null stop condition", until(Value::Null), "/scenario/until", "an object"),
        one_fault("zero wear depth", until(json!({"wear_depth": 0})), depth, "greater than 0"),
        one_fault("volume in mm²", until(json!({"wear_volume": "1 mm^2"})), volume, "mm^3"),
        one_fault("share of 1.5", share(json!(1.5)), "/scenario/wear/share", "between 0.0 and 1.0"),
        one_fault("share in words", share(json!("half")), "/scenario/wear/share", "a number"),
        one_fault("compare with 1", compare(json!(1)), "/scenario/model/compare", "a boolean"),
        one_fault(
            "flat wider than the contact",
            profile(flat),
            "/scenario/load/normal_force",
            "ring",
        ),
        one_fault(
            "stick ratio below the flat",
            json!({
                "profile": {
                    "shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": "150 um",
                },
                "motion": {"stick_ratio": 0.3},
            }),
            "/scenario/motion/stick_ratio",
            "under the flat",
        ),
        one_fault(
            "table that begins off the axis",
            table(json!([1e-5, 1e-3]), json!([0, 1e-4])),
            "/scenario/profile/radius/0",
            "must be 0",
        ),
        one_fault(
            "table with an extra radius",
            table(json!([0, 5e-4, 1e-3]), json!([0, 1e-4])),
            "/scenario/profile/height",
            "as many entries",
        ),
        one_fault(
            "flat table",
            table(json!([0, 1e-3]), json!([0, 0])),
            "/scenario/profile/height/1",
            "flat",
        ),
        one_fault(
            "table with a radius twice",
            table(json!([0, 5e-4, 5e-4, 1e-3]), json!([0, 1e-5, 1e-5, 5e-5])),
            "/scenario/profile/radius/2",
            "greater than the radius before it",
        ),
    ])
    .await;
}

/// Sends the head of a request. The caller sends the body later.
async fn send_head(server: &Server, head: &str, length: usize) -> TcpStream {
    let mut connection = TcpStream::connect(server.address).await.unwrap();
    let head = format!("{head}Host: localhost\r\nContent-Length: {length}\r\n\r\n");
    connection.write_all(head.as_bytes()).await.unwrap();
    connection
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_stays_usable_if_the_answer_precedes_the_body() {
    let server = Server::start().await;
    let json = "Content-Type: application/json\r\n";
    for (status, head, length) in [
        (415, "POST /v1/jobs HTTP/1.1\r\n".to_owned(), 200_000),
        (404, format!("POST /nowhere HTTP/1.1\r\n{json}"), 200_000),
        (405, format!("POST /healthz HTTP/1.1\r\n{json}"), 200_000),
        (403, format!("POST /v1/jobs HTTP/1.1\r\n{json}Origin: http://evil.example\r\n"), 200_000),
        (200, "GET /healthz HTTP/1.1\r\n".to_owned(), 200_000),
        (413, format!("POST /v1/jobs HTTP/1.1\r\n{json}"), (4 << 20) + 1),
    ] {
        let mut connection = send_head(&server, &head, length).await;
        let early = answer(&mut connection).await.unwrap();
        assert_eq!((early.status, early.header("connection")), (status, None), "{head}");
        connection.write_all(&vec![b' '; length]).await.unwrap();
        let next = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
        connection.write_all(next).await.unwrap();
        let next = answer(&mut connection).await;
        assert_eq!(next.map(|reply| reply.status).ok(), Some(200), "after {status} to {head}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_connection_closes_when_the_unread_body_is_too_large() {
    let server = Server::start().await;
    let head = "POST /v1/jobs HTTP/1.1\r\n";
    let mut connection = send_head(&server, head, 1 << 30).await;
    // The client has sent 8 MiB before it reads the answer. The answer must still arrive.
    connection.write_all(&vec![b' '; 8 << 20]).await.unwrap();
    let early = answer(&mut connection).await.unwrap();
    assert_eq!((early.status, early.header("connection")), (415, Some("close")));

    // A client that sends `Expect: 100-continue` gets the refusal instead of a 100.
    let head = format!("{head}Expect: 100-continue\r\n");
    let mut connection = send_head(&server, &head, 1000).await;
    let mut text = String::new();
    connection.read_to_string(&mut text).await.unwrap();
    assert!(text.starts_with("HTTP/1.1 415 ") && text.contains("connection: close"), "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn accept_encoding_never_causes_a_refusal() {
    let server = Server::start().await;
    for accepted in ["identity;q=0", "*;q=0", "*;q=0.0, IDENTITY ; Q=0.000", "gzip;q=0, *;q=0"] {
        let coding = ("Accept-Encoding", accepted);
        let ball = steel_ball().to_string();
        let ask = async |method, target, status| {
            let headers = [JSON, ("Prefer", "wait=60"), coding];
            let reply = server.send(method, target, &headers, &ball).await;
            assert_eq!((reply.status, reply.header("content-encoding")), (status, None));
            reply
        };
        assert_eq!(ask("POST", "/v1/jobs", 200).await.json()["state"], "succeeded", "{accepted}");
        ask("GET", "/v1/jobs?no=1", 422).await.problem(422, "invalid-parameters");
        ask("GET", "/nowhere", 404).await.problem(404, "not-found");
        ask("GET", "/openapi.json", 200).await;
    }
    let packed = [("Accept-Encoding", "gzip, identity;q=0, *;q=0")];
    let packed = server.send("GET", "/openapi.json", &packed, "").await;
    assert_eq!((packed.status, packed.header("content-encoding")), (200, Some("gzip")));
}
