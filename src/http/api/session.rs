//! The session of a browser: sign in and out.

use axum::extract::Request;
use axum::http::{HeaderName, StatusCode, header};

use crate::http::access::Identity;
use crate::http::access::session::{Site, set_cookie, token};
use crate::http::{App, NoQuery, Problem, Result, kinds};

/// The answer to signing in and out.
type SessionAnswer = (StatusCode, [(HeaderName, String); 2]);

fn answer(request: &Request, token: Option<&str>) -> SessionAnswer {
    let private = (header::CACHE_CONTROL, "no-store".to_owned());
    (StatusCode::NO_CONTENT, [set_cookie(request, token), private])
}

/// Signs a browser in with an access key.
///
/// The answer sets a cookie, which takes the place of the key in all tabs of the browser: HttpOnly, SameSite=Lax, and Secure
/// behind a trusted proxy with TLS. The session ends after a week, or when its key expires or is revoked. The server
/// accepts the cookie only from its own pages.
#[utoipa::path(post, path = "/v1/session", operation_id = "sign_in", tag = "system", responses(
    (status = 204, description = "The browser is signed in.",
        headers(("Set-Cookie" = String, description = "The cookie."))),
))]
pub async fn sign_in(app: App, _: NoQuery, request: Request) -> Result<SessionAnswer> {
    if Site::of(&request) == Site::Other {
        let detail = "A web page of another origin cannot sign in.";
        return Err(Problem::new(&kinds::CROSS_SITE, detail));
    }
    let identity = request.extensions().get::<Identity>();
    let Some(by) = identity.and_then(|identity| identity.credential.clone()) else {
        let detail = "Only an access key can sign in, and this request has none.";
        return Err(Problem::new(&kinds::FORBIDDEN, detail));
    };
    // The browser gets a new token, so nobody can know it in advance. The session before it ends.
    if let Some(token) = token(&request)? {
        app.store.end_session(&token).await?;
    }
    let token = app.store.begin_session(by).await?;
    app.unencrypted.warn(&request);
    Ok(answer(&request, Some(&token)))
}

/// Signs a browser out.
///
/// Ends the session of the cookie and deletes the cookie. Without a cookie it does nothing.
#[utoipa::path(delete, path = "/v1/session", operation_id = "sign_out", tag = "system", responses(
    (status = 204, description = "The session has ended."),
))]
pub async fn sign_out(app: App, _: NoQuery, request: Request) -> Result<SessionAnswer> {
    if let Some(token) = token(&request)? {
        app.store.end_session(&token).await?;
        tracing::debug!("a browser has signed out");
    }
    Ok(answer(&request, None))
}
