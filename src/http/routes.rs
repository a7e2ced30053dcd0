//! The routes, each with its documentation and the role that it requires.

use axum::Router;
use axum::handler::Handler;
use axum::http::Method;
use axum::response::Redirect;
use axum::routing::{MethodFilter, MethodRouter, get, on};
use pastey::paste;
use utoipa::__dev::{SchemaReferences, Tags};
use utoipa::Path;
use utoipa::openapi::HttpMethod;

use super::access::needs::{Needs, RouteNeeds};
use super::api::{
    audit, derivatives, diff, evaluate, events, jobs, keys, library, links, me, measurements,
    report, results, scenarios, search, session, smooth, system, umbridge, verdict,
};
use super::app::App;
use super::dashboard;
use super::dashboard::{docs, swagger};

/// A handler, and the type that its attribute `utoipa::path` makes.
macro_rules! route {
    ($module:ident::$handler:ident) => {
        paste!(($module::[<__path_ $handler>], $module::$handler))
    };
}

/// The routes, and what they require.
#[derive(Default)]
pub struct Routes {
    pub router: Router<App>,
    pub needs: RouteNeeds,
    /// The documentation, from which a test makes the OpenAPI document.
    #[cfg(test)]
    pub documentation: super::openapi::Documentation,
}

impl Routes {
    /// All routes.
    pub fn all() -> Self {
        Self::default()
            .add(Needs::SUBMIT, route!(jobs::submit))
            .add(Needs::READ, route!(jobs::list))
            .add(Needs::READ, route!(jobs::show))
            .add(Needs::SUBMIT, route!(jobs::rename))
            .add(Needs::CANCEL, route!(jobs::delete))
            .add(Needs::READ, route!(jobs::result))
            .add(Needs::READ, route!(jobs::so_far))
            .add(Needs::CANCEL, route!(jobs::cancel))
            .add(Needs::CANCEL, route!(jobs::cancel_all))
            .add(Needs::READ, route!(events::follow))
            .add(Needs::READ, route!(search::list))
            .add(Needs::READ, route!(diff::diff))
            .add(Needs::READ, route!(results::whole))
            .add(Needs::ADMIN, route!(library::delete))
            .add(Needs::READ, route!(results::history))
            .add(Needs::DERIVE, route!(smooth::smooth))
            .add(Needs::READ, route!(results::profiles))
            .add(Needs::READ, route!(results::loops))
            .add(Needs::READ, route!(results::table))
            .add(Needs::READ, route!(results::statistics))
            .add(Needs::READ, route!(results::histogram))
            .add(Needs::READ, route!(verdict::verdict))
            .add(Needs::READ, route!(results::plot))
            .add(Needs::READ, route!(report::report))
            .add(Needs::DERIVE, route!(derivatives::derivatives))
            .add(Needs::SUBMIT, route!(results::pin))
            .add(Needs::SUBMIT, route!(results::unpin))
            .add(Needs::SUBMIT, route!(links::share))
            .add(Needs::READ, route!(library::provenance))
            .add(Needs::READ, route!(library::warnings))
            .add(Needs::READ, route!(library::show_note))
            .add(Needs::READ, route!(search::about))
            .add(Needs::SUBMIT, route!(library::note))
            .add(Needs::SUBMIT, route!(library::delete_note))
            .add(Needs::EVALUATE, route!(evaluate::evaluate))
            .add(Needs::EVALUATE, route!(measurements::read))
            .add(Needs::READ, route!(scenarios::check))
            .add(Needs::NOTHING, route!(scenarios::examples))
            .add(Needs::NOTHING, route!(scenarios::example))
            .add(Needs::NOTHING, route!(scenarios::schema))
            .add(Needs::READ, route!(me::me))
            .add(Needs::READ, route!(session::sign_in))
            .add(Needs::READ, route!(session::sign_out))
            .add(Needs::ADMIN, route!(audit::audit))
            .add(Needs::ADMIN, route!(keys::list))
            .add(Needs::ADMIN, route!(keys::make))
            .add(Needs::ADMIN, route!(keys::revoke))
            .monitoring()
            .add(Needs::READ, route!(system::version))
            .add(Needs::NOTHING, route!(system::openapi))
            .add(Needs::NOTHING, route!(system::problems))
            .add(Needs::NOTHING, route!(system::explain))
            // The dashboard and the documents contain no data of users. The requests that they send require a role.
            .page(Needs::NOTHING, "/", get(dashboard::page))
            .page(Needs::NOTHING, "/assets/{*name}", get(dashboard::asset))
            .page(Needs::NOTHING, "/docs", get(|| async { Redirect::to("/docs/") }))
            .page(Needs::NOTHING, "/docs/", get(docs::start))
            .page(Needs::NOTHING, "/docs/{*name}", get(docs::page))
            .page(Needs::NOTHING, "/docs/api", get(|| async { Redirect::to("/docs/api/") }))
            .page(Needs::NOTHING, "/docs/api/", get(swagger::start))
            .page(Needs::NOTHING, "/docs/api/{*path}", get(swagger::page))
            .umbridge()
    }

    /// Adds the routes for monitors: health, readiness and metrics.
    pub fn monitoring(self) -> Self {
        self.add(Needs::NOTHING, route!(system::health))
            .add(Needs::NOTHING, route!(system::ready))
            .add(Needs::READ, route!(system::metrics))
    }

    /// Adds the routes of UM-Bridge, which has its own documentation.
    pub fn umbridge(self) -> Self {
        umbridge::ROUTES.iter().fold(self, |routes, (path, method, needs, handler)| {
            routes.undocumented(method.clone(), *needs, path, handler())
        })
    }

    /// Adds a documented route.
    fn add<P: Path + SchemaReferences + Tags<'static>, H: Handler<T, App>, T: 'static>(
        self,
        needs: Needs,
        (_, handler): (P, H),
    ) -> Self {
        #[cfg(test)]
        let this = Self { documentation: self.documentation.with::<P>(), ..self };
        #[cfg(not(test))]
        let this = self;
        let (method, filter) = match P::methods()[..] {
            [HttpMethod::Get] => (Method::GET, MethodFilter::GET),
            [HttpMethod::Post] => (Method::POST, MethodFilter::POST),
            [HttpMethod::Put] => (Method::PUT, MethodFilter::PUT),
            [HttpMethod::Patch] => (Method::PATCH, MethodFilter::PATCH),
            [HttpMethod::Delete] => (Method::DELETE, MethodFilter::DELETE),
            _ => unreachable!("each handler has one of these methods"),
        };
        this.undocumented(method, needs, &P::path(), on(filter, handler))
    }

    /// Adds a page for browsers, which is not part of the documented API.
    fn page(self, needs: Needs, path: &str, page: MethodRouter<App>) -> Self {
        self.undocumented(Method::GET, needs, path, page)
    }

    fn undocumented(
        mut self,
        method: Method,
        needs: Needs,
        path: &str,
        route: MethodRouter<App>,
    ) -> Self {
        self.needs.declare(path, method, needs);
        Self { router: self.router.route(path, route), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::api::system::DOCUMENT;
    use crate::http::openapi::complete;

    #[test]
    fn each_route_requires_its_declared_role() {
        let all = Routes::all().needs;
        for (method, route, needs) in [
            (Method::GET, "/healthz", Needs::NOTHING),
            (Method::HEAD, "/assets/{*name}", Needs::NOTHING),
            (Method::GET, "/v1/jobs", Needs::READ),
            (Method::POST, "/v1/scenarios", Needs::READ),
            (Method::POST, "/v1/jobs", Needs::SUBMIT),
            (Method::POST, "/v1/evaluate", Needs::EVALUATE),
            (Method::POST, "/v1/measurements", Needs::EVALUATE),
            (Method::GET, "/v1/results/{key}/derivatives", Needs::DERIVE),
            (Method::POST, "/Gradient", Needs::EVALUATE),
            (Method::PUT, "/v1/results/{key}/pin", Needs::SUBMIT),
            (Method::PATCH, "/v1/jobs/{id}", Needs::SUBMIT),
            (Method::POST, "/v1/jobs/{id}/cancel", Needs::CANCEL),
            (Method::DELETE, "/v1/results/{key}", Needs::ADMIN),
            // An unknown route requires a key too.
            (Method::PATCH, "", Needs::SUBMIT),
            (Method::GET, "", Needs::READ),
        ] {
            assert_eq!(all.of(&method, route), needs, "{method} {route}");
        }
    }

    #[test]
    fn the_committed_openapi_document_is_up_to_date() {
        let Routes { needs, documentation, .. } = Routes::all();
        let current = complete(documentation, &needs);
        if current != DOCUMENT {
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/openapi.json");
            let written = match std::fs::write(path, current) {
                Ok(()) => "This test has written it; run the tests again.".to_owned(),
                Err(error) => format!("This test could not write it: {error}"),
            };
            panic!("openapi/openapi.json is out of date. {written}");
        }
    }
}
