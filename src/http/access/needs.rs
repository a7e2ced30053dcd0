//! The role that each route requires.

use std::collections::HashMap;

use axum::http::Method;

use fretwork_store::Role;

/// The limits of calls per minute that each key has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quota {
    /// The limit of all calls except evaluations.
    Requests,
    /// The limit of evaluations.
    Evaluations,
}

/// What a route requires of its caller. It is declared where the route is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// The lowest role that may call the route; `None` if no key is required.
    pub role: Option<Role>,
    /// The limit that a call counts against. `None` if it counts against none.
    pub quota: Option<Quota>,
}

impl Needs {
    /// No key: the route returns no data of users.
    pub const NOTHING: Self = Self { role: None, quota: None };
    /// For routes that only read.
    pub const READ: Self = Self { role: Some(Role::Read), quota: Some(Quota::Requests) };
    /// For routes that submit or change something.
    pub const SUBMIT: Self = Self { role: Some(Role::Submit), quota: Some(Quota::Requests) };
    /// For routes that compute without a job.
    pub const EVALUATE: Self = Self { role: Some(Role::Submit), quota: Some(Quota::Evaluations) };
    /// For routes that compute from a stored result.
    pub const DERIVE: Self = Self { role: Some(Role::Read), quota: Some(Quota::Evaluations) };
    /// For routes that cancel or delete jobs. This reduces the load of the server, so a key that has reached its limit
    /// may call them too.
    pub const CANCEL: Self = Self { role: Some(Role::Submit), quota: None };
    /// For routes of administrators.
    pub const ADMIN: Self = Self { role: Some(Role::Admin), quota: Some(Quota::Requests) };
}

/// What all routes require, by path and method.
#[derive(Debug, Default)]
pub struct RouteNeeds(HashMap<String, Vec<(Method, Needs)>>);

impl RouteNeeds {
    /// Declares what a route requires.
    pub fn declare(&mut self, route: &str, method: Method, needs: Needs) {
        self.0.entry(route.to_owned()).or_default().push((method, needs));
    }

    /// What a route requires. An unknown route requires a key too.
    pub fn of(&self, method: &Method, route: &str) -> Needs {
        let method = if *method == Method::HEAD { &Method::GET } else { method };
        let declared = self.0.get(route).and_then(|all| all.iter().find(|(of, _)| of == method));
        match declared {
            Some((_, needs)) => *needs,
            None if *method == Method::GET => Needs::READ,
            None => Needs::SUBMIT,
        }
    }
}
