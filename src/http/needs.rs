//! The role that each route requires.

use std::collections::HashMap;

use axum::http::Method;

use crate::store::Role;

/// What a route requires of its caller. It is declared where the route is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// The lowest role that may call the route; `None` if no key is required.
    pub role: Option<Role>,
    /// Whether a call counts against the limits of its key.
    pub counted: bool,
}

impl Needs {
    /// No key: the route returns no data of users.
    pub const NOTHING: Self = Self { role: None, counted: false };
    /// To read.
    pub const READ: Self = Self { role: Some(Role::Read), counted: true };
    /// To submit and to change.
    pub const SUBMIT: Self = Self { role: Some(Role::Submit), counted: true };
    /// To cancel and to delete jobs. This frees the server, so a key at its limit may do it too.
    pub const CANCEL: Self = Self { role: Some(Role::Submit), counted: false };
    /// To administrate.
    pub const ADMIN: Self = Self { role: Some(Role::Admin), counted: true };
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
