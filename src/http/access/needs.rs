//! The role that each route requires.

use std::collections::HashMap;

use axum::http::Method;

use fretwork_store::Role;

/// A number of calls per minute that a key has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quota {
    /// Of all calls except evaluations.
    Requests,
    /// Of evaluations.
    Evaluations,
}

/// What a route requires of its caller. It is declared where the route is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// The lowest role that may call the route; `None` if no key is required.
    pub role: Option<Role>,
    /// What a call counts against. `None` if it does not count against any limit.
    pub quota: Option<Quota>,
}

impl Needs {
    /// No key: the route returns no data of users.
    pub const NOTHING: Self = Self { role: None, quota: None };
    /// To read.
    pub const READ: Self = Self { role: Some(Role::Read), quota: Some(Quota::Requests) };
    /// To submit and to change.
    pub const SUBMIT: Self = Self { role: Some(Role::Submit), quota: Some(Quota::Requests) };
    /// To compute without a job.
    pub const EVALUATE: Self = Self { role: Some(Role::Submit), quota: Some(Quota::Evaluations) };
    /// To compute from a stored result.
    pub const DERIVE: Self = Self { role: Some(Role::Read), quota: Some(Quota::Evaluations) };
    /// To cancel and to delete jobs. This frees the server, so a key at its limit may do it too.
    pub const CANCEL: Self = Self { role: Some(Role::Submit), quota: None };
    /// To administrate.
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

    /// What a route requires. An unknown route is not open.
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
