//! Encrypted connections to PostgreSQL, with certificates of an authority of our own.

use std::fs;
use std::net::TcpListener;

use data_encoding::BASE64;
use fretwork_store::{Options, Place, Store};
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair, date_time_ymd};
use sqlx::{AssertSqlSafe, Connection as _, Executor as _, PgConnection};
use tempfile::TempDir;

use crate::database::Cluster;
use crate::keeping::eventually;
use crate::program::{fails, run, text};

/// A PostgreSQL that listens by TCP, and the authority that its clients trust.
struct Encrypted {
    _cluster: Cluster,
    port: u16,
    authority: CertifiedIssuer<'static, KeyPair>,
    /// Has the certificate of the authority.
    dir: TempDir,
    /// A connection by the Unix socket.
    db: PgConnection,
}

impl Encrypted {
    async fn start() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let cluster = Cluster::start(&["--port", &port.to_string()]);
        let (authority, dir) = (authority(), TempDir::new().unwrap());
        fs::write(dir.path().join("root.crt"), authority.pem()).unwrap();
        let db = PgConnection::connect(cluster.address()).await.unwrap();
        Self { _cluster: cluster, port, authority, dir, db }
    }

    /// Replaces the certificate of the server by one for `localhost` that is valid up to this year, and its setting `ssl`.
    async fn present(&mut self, last_year: i32, ssl: &str) {
        let key = KeyPair::generate().unwrap();
        let mut wanted = CertificateParams::new(["localhost".to_owned()]).unwrap();
        wanted.not_after = date_time_ymd(last_year, 1, 1);
        let certificate = wanted.signed_by(&key, &self.authority).unwrap();
        for (name, content) in [("crt", certificate.pem()), ("key", key.serialize_pem())] {
            // The files must belong to the user of the server, who writes them.
            let content = BASE64.encode(content.as_bytes());
            self.execute(&format!(
                "COPY (SELECT '{content}') TO PROGRAM 'umask 077; base64 -d > server.{name}'"
            ))
            .await;
        }
        self.execute(&format!("ALTER SYSTEM SET ssl = '{ssl}'")).await;
        self.execute("SELECT pg_reload_conf()").await;
    }

    async fn execute(&mut self, statement: &str) {
        self.db.execute(AssertSqlSafe(statement)).await.unwrap();
    }

    fn address(&self, host: &str) -> String {
        let root = self.dir.path().join("root.crt");
        format!(
            "postgres://fretwork:secret@{host}:{}/postgres?sslrootcert={}",
            self.port,
            root.display()
        )
    }

    /// Waits until the server refuses new connections to this host for this reason, in a message without the password.
    async fn refuses(&self, host: &str, reason: &str) {
        let address = self.address(host);
        let said = || {
            let output = run(&["keys", "list", "--database", &address], "");
            fails(&output, "refused, because it is not secure");
            let said = text(&output.stderr).to_owned();
            assert!(!said.contains("secret"), "{said}");
            said
        };
        // A new process of the server may still have the earlier certificate.
        eventually(async || said().contains(reason)).await;
    }
}

pub fn authority() -> CertifiedIssuer<'static, KeyPair> {
    let mut wanted = CertificateParams::new([]).unwrap();
    wanted.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    CertifiedIssuer::self_signed(wanted, KeyPair::generate().unwrap()).unwrap()
}

/// Opens the store, as a server does.
async fn open(address: &str) -> Result<Store, fretwork_store::Error> {
    Store::open(Place::Shared(address.parse().unwrap()), &Options::default()).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_of_postgresql_must_prove_its_name_by_a_valid_certificate() {
    let mut server = Encrypted::start().await;
    server.present(4000, "on").await;
    let address = server.address("localhost");
    eventually(async || open(&address).await.is_ok()).await;
    let store = open(&address).await.unwrap();
    let open = "SELECT count(*) FROM pg_stat_activity NATURAL JOIN pg_stat_ssl
        WHERE client_addr IS NOT NULL AND NOT ssl";
    let plain: i64 = sqlx::query_scalar(open).fetch_one(&mut server.db).await.unwrap();
    assert_eq!(plain, 0, "connections without encryption");
    store.close().await;

    server.refuses("127.0.0.1", "certificate not valid for name \"127.0.0.1\"").await;
    let trusted = fs::read(server.dir.path().join("root.crt")).unwrap();
    fs::write(server.dir.path().join("root.crt"), authority().pem()).unwrap();
    server.refuses("localhost", "certificate").await;
    fs::write(server.dir.path().join("root.crt"), trusted).unwrap();
    server.present(2001, "on").await;
    server.refuses("localhost", "certificate expired").await;
    server.present(4000, "off").await;
    server.refuses("localhost", "server does not support TLS").await;
}

#[test]
fn an_address_that_allows_connections_without_encryption_is_refused() {
    let address = "postgres://ada:secret@db.example/wear?sslmode=prefer";
    let output = run(&["worker", "--database", address], "");
    fails(&output, "an attacker on the network can switch the encryption off");
    assert!(!text(&output.stderr).contains("secret"), "{}", text(&output.stderr));
}
