//! What the spin thread serves side by side: each part for ever, so that the end of any is a fault.

use std::future::Future;

use futures::FutureExt;
use futures::future::{LocalBoxFuture, select_all};

/// Something that is served.
pub struct Part<'a> {
    name: &'static str,
    served: LocalBoxFuture<'a, ()>,
}

impl<'a> Part<'a> {
    /// Serves `what`.
    pub fn new(what: &'static str, served: impl Future<Output = ()> + 'a) -> Self {
        Self { name: what, served: served.boxed_local() }
    }
}

/// Serves all of them until the first ends, and gives its name.
///
/// # Panics
/// If there are none.
pub async fn first_to_end(parts: Vec<Part<'_>>) -> &'static str {
    let (names, served): (Vec<_>, Vec<_>) = parts.into_iter().map(|part| (part.name, part.served)).unzip();
    let ((), at, _) = select_all(served).await;
    names[at]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_part_that_ends_is_named_while_the_others_go_on() {
        let parts = vec![
            Part::new("a stream", std::future::pending()),
            Part::new("discovery", async { smol::future::yield_now().await }),
            Part::new("a service", std::future::pending()),
        ];
        assert_eq!(smol::block_on(first_to_end(parts)), "discovery");
    }
}
