//! Swagger UI, which shows the OpenAPI document. Its files are part of the program, so it works without a network.

use std::io::{Cursor, Read as _};
use std::sync::LazyLock;

use axum::http::HeaderMap;
use axum::response::Response;
use utoipa_swagger_ui_vendored::SWAGGER_UI_VENDORED;
use zip::ZipArchive;
use zip::result::ZipResult;

use super::asset::{Asset, Assets};
use crate::http::{Result, Segment};

/// The files of the archive that the page uses, and their media types.
const FILES: [(&str, &str); 7] = [
    ("index.html", "text/html; charset=utf-8"),
    ("index.css", "text/css"),
    ("swagger-ui.css", "text/css"),
    ("swagger-ui-bundle.js", "text/javascript"),
    ("swagger-ui-standalone-preset.js", "text/javascript"),
    ("favicon-16x16.png", "image/png"),
    ("favicon-32x32.png", "image/png"),
];
const START: &str = r##"window.onload = () => {
  window.ui = SwaggerUIBundle({
    url: "/openapi.json",
    dom_id: "#swagger-ui",
    deepLinking: true,
    displayRequestDuration: true,
    layout: "StandaloneLayout",
    plugins: [SwaggerUIBundle.plugins.DownloadUrl],
    presets: [SwaggerUIBundle.presets.apis, SwaggerUIStandalonePreset],
    tryItOutEnabled: true,
  });
};
"##;
const POLICY: &str = "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
    frame-ancestors 'none'";

#[expect(clippy::expect_used, reason = "the archive is part of the program, and a test reads it")]
static ASSETS: Assets = Assets {
    all: LazyLock::new(|| unpack().expect("the files of Swagger UI")),
    policy: POLICY,
    none: "Swagger UI does not have this file. Open /docs/api/ instead.",
};

fn unpack() -> ZipResult<Vec<Asset>> {
    let mut archive = ZipArchive::new(Cursor::new(SWAGGER_UI_VENDORED))?;
    let folder = archive.by_index(0)?.name()?.into_owned();
    let mut assets =
        vec![Asset::new("swagger-initializer.js", "text/javascript", START.as_bytes())];
    for (name, media_type) in FILES {
        let mut bytes = Vec::new();
        archive.by_name(&format!("{folder}dist/{name}"))?.read_to_end(&mut bytes)?;
        assets.push(Asset::new(name, media_type, &bytes));
    }
    Ok(assets)
}

/// `GET /docs/api/`.
pub async fn start(headers: HeaderMap) -> Result<Response> {
    ASSETS.answer("index.html", &headers).await
}

/// `GET /docs/api/{path}`.
pub async fn page(path: Segment, headers: HeaderMap) -> Result<Response> {
    ASSETS.answer(&path, &headers).await
}
