//! The handlers, one file for each kind of resource. A handler translates the request, calls the service, and
//! translates its answer.

pub mod audit;
pub mod derivatives;
pub mod diff;
pub mod documents;
pub mod evaluate;
pub mod events;
pub mod jobs;
pub mod keys;
pub mod library;
pub mod links;
pub mod me;
pub mod measurements;
pub mod parameters;
pub mod report;
pub mod results;
pub mod scenarios;
pub mod search;
pub mod session;
pub mod smooth;
pub mod system;
pub mod umbridge;
pub mod verdict;
