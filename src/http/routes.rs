//! The routes, each with its documentation and the role that it requires.

use axum::http::Method;
use axum::response::Redirect;
use axum::routing::{MethodRouter, get};
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter};
use utoipa_axum::routes;

use super::access::needs::{Needs, RouteNeeds};
use super::api::{
    audit, derivatives, diff, evaluate, events, jobs, keys, library, links, me, measurements,
    report, results, scenarios, search, session, smooth, system, umbridge, verdict,
};
use super::app::App;
use super::dashboard::{docs, swagger};
use super::{dashboard, openapi};

/// The routes with their documentation, and what they require.
#[derive(Default)]
pub struct Routes {
    pub router: OpenApiRouter<App>,
    pub needs: RouteNeeds,
}

impl Routes {
    /// All routes.
    pub fn all() -> Self {
        Self { router: OpenApiRouter::with_openapi(openapi::frame()), ..Self::default() }
            .add(Needs::SUBMIT, routes!(jobs::submit))
            .add(Needs::READ, routes!(jobs::list))
            .add(Needs::READ, routes!(jobs::show))
            .add(Needs::SUBMIT, routes!(jobs::rename))
            .add(Needs::CANCEL, routes!(jobs::delete))
            .add(Needs::READ, routes!(jobs::result))
            .add(Needs::READ, routes!(jobs::so_far))
            .add(Needs::CANCEL, routes!(jobs::cancel))
            .add(Needs::CANCEL, routes!(jobs::cancel_all))
            .add(Needs::READ, routes!(events::follow))
            .add(Needs::READ, routes!(search::list))
            .add(Needs::READ, routes!(diff::diff))
            .add(Needs::READ, routes!(results::whole))
            .add(Needs::ADMIN, routes!(library::delete))
            .add(Needs::READ, routes!(results::history))
            .add(Needs::DERIVE, routes!(smooth::smooth))
            .add(Needs::READ, routes!(results::profiles))
            .add(Needs::READ, routes!(results::loops))
            .add(Needs::READ, routes!(results::table))
            .add(Needs::READ, routes!(results::statistics))
            .add(Needs::READ, routes!(results::histogram))
            .add(Needs::READ, routes!(verdict::verdict))
            .add(Needs::READ, routes!(results::plot))
            .add(Needs::READ, routes!(report::report))
            .add(Needs::DERIVE, routes!(derivatives::derivatives))
            .add(Needs::SUBMIT, routes!(results::pin, results::unpin))
            .add(Needs::SUBMIT, routes!(links::share))
            .add(Needs::READ, routes!(library::provenance))
            .add(Needs::READ, routes!(library::warnings))
            .add(Needs::READ, routes!(library::show_note))
            .add(Needs::READ, routes!(search::about))
            .add(Needs::SUBMIT, routes!(library::note, library::delete_note))
            .add(Needs::EVALUATE, routes!(evaluate::evaluate))
            .add(Needs::EVALUATE, routes!(measurements::read))
            .add(Needs::READ, routes!(scenarios::check))
            .add(Needs::NOTHING, routes!(scenarios::examples))
            .add(Needs::NOTHING, routes!(scenarios::example))
            .add(Needs::NOTHING, routes!(scenarios::schema))
            .add(Needs::READ, routes!(me::me))
            .add(Needs::READ, routes!(session::sign_in, session::sign_out))
            .add(Needs::ADMIN, routes!(audit::audit))
            .add(Needs::ADMIN, routes!(keys::list, keys::make))
            .add(Needs::ADMIN, routes!(keys::revoke))
            .monitoring()
            .add(Needs::READ, routes!(system::version))
            .add(Needs::NOTHING, routes!(system::openapi))
            .add(Needs::NOTHING, routes!(system::problems))
            .add(Needs::NOTHING, routes!(system::explain))
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
        self.add(Needs::NOTHING, routes!(system::health))
            .add(Needs::NOTHING, routes!(system::ready))
            .add(Needs::READ, routes!(system::metrics))
    }

    /// Adds the routes of UM-Bridge, which has its own documentation.
    pub fn umbridge(self) -> Self {
        umbridge::ROUTES.iter().fold(self, |routes, (path, method, needs, handler)| {
            routes.undocumented(method.clone(), *needs, path, handler())
        })
    }

    /// Adds documented routes.
    fn add(mut self, needs: Needs, routes: UtoipaMethodRouter<App>) -> Self {
        for (path, item) in &routes.1.paths {
            let operations = [
                (Method::GET, &item.get),
                (Method::POST, &item.post),
                (Method::PUT, &item.put),
                (Method::PATCH, &item.patch),
                (Method::DELETE, &item.delete),
            ];
            for (method, _) in operations.into_iter().filter(|(_, operation)| operation.is_some()) {
                self.needs.declare(path, method, needs);
            }
        }
        Self { router: self.router.routes(routes), ..self }
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
}
