//! The Fast Iterative Method over tiles: which tile is solved when, by whom, and where values are kept meanwhile.
//!
//! A tile is solved by Gauss–Seidel sweeps until it converges, then activates the neighbours that it could improve,
//! each with a *key*: the least changed value that could improve it. Tiles are taken in rounds in order of key,
//! which makes the method nearly label-setting; in order of arrival it would solve whole regions again
//! each time a later, shorter front arrives. A round is a set of tiles no two of which are neighbours, so they can be solved
//! at the same time and the outcome does not depend on which thread solves which.
//!
//! | file | answers |
//! |---|---|
//! | `tile_store` | where are values kept? a trait; `memory` is the first store |
//! | `values` | who reads them later, and what if that fails? |
//! | `active_set` | which tiles wait, and which are next? |
//! | `rounds` | what happens in a round and after it? |
//! | `stop` | when is it over? |
//! | `worker_pool` | which thread does which job? |
//! | `solution` | all of it, from the values that are given to those of the solution |
//!
//! Jeong and Whitaker, "A Fast Iterative Method for Eikonal Equations", SIAM J. Sci. Comput. 30 (2008).

pub(super) mod active_set;
pub(super) mod memory;
pub(super) mod rounds;
pub(super) mod solution;
pub(super) mod stop;
pub(super) mod tile_store;
pub(super) mod values;
pub(super) mod worker_pool;
