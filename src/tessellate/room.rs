//! How many points triangles may take.

use std::sync::atomic::{AtomicUsize, Ordering};

/// What is left of the points that all faces may have together.
///
/// What is taken beyond that is not given back, so that whether there was enough depends on nothing but
/// what was asked for.
#[derive(Debug)]
pub(super) struct Room(AtomicUsize);

impl Room {
    pub(super) fn new(most: usize) -> Self {
        Self(AtomicUsize::new(most))
    }

    /// Takes some of it; whether there was enough. A share of a point counts as one, and what is not
    /// a number as too many.
    pub(super) fn take(&self, points: f64) -> bool {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "no more than there is"
        )]
        let rest = |left: usize| {
            let is_enough = (0.0..=left as f64).contains(&points);
            Some(if is_enough {
                left - points.ceil() as usize
            } else {
                0
            })
        };
        let had = self
            .0
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, rest);
        had.is_ok() && self.is_left()
    }

    /// Whether not all has been taken.
    pub(super) fn is_left(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_much_leaves_nothing() {
        let room = Room::new(10);
        assert!(room.take(4.0) && room.take(0.5) && room.take(4.0));
        assert!(!room.take(2.0) && !room.take(0.0));
        for wrong in [f64::NAN, f64::INFINITY, 11.0] {
            assert!(!Room::new(10).take(wrong));
        }
    }
}
