//! Which instructions this processor has, and the search compiled for each set.
//!
//! All sets compute the same numbers: the code is the same, without fused operations, and
//! only more of it runs side by side.

use std::ops::Range;

use kernel::Ray;

use super::trace::Collector;
use super::{Accelerator, Workspace};
use crate::intersect::Intersector;

/// A set of instructions that the search is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Isa {
    /// Whatever the target has.
    Portable,
    /// AVX2 of x86-64.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 of x86-64.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// All sets that this processor can run, the best one last.
    pub(crate) fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "other architectures have the portable set only")]
        let mut sets = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                sets.push(Self::Avx2);
            }
            if is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
            {
                sets.push(Self::Avx512);
            }
        }
        sets
    }

    /// The best set of this processor.
    pub(crate) fn detect() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }
}

impl Accelerator<'_> {
    /// Offers every candidate in `range` to `collector`, on the best instructions there are.
    #[cfg_attr(
        target_arch = "x86_64",
        expect(unsafe_code, reason = "the processor was asked for these instructions")
    )]
    pub(super) fn search<I: Intersector>(
        &self,
        ray: &Ray,
        range: Range<f64>,
        workspace: &mut Workspace,
        collector: &mut impl Collector,
    ) {
        match self.isa {
            Isa::Portable => self.search_with::<I>(ray, range, workspace, collector),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Isa::available` found the instructions on this processor.
            Isa::Avx2 => unsafe { search_avx2::<I>(self, ray, range, workspace, collector) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Isa::Avx512 => unsafe { search_avx512::<I>(self, ray, range, workspace, collector) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn search_avx2<I: Intersector>(
    accelerator: &Accelerator<'_>,
    ray: &Ray,
    range: Range<f64>,
    workspace: &mut Workspace,
    collector: &mut impl Collector,
) {
    accelerator.search_with::<I>(ray, range, workspace, collector);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq")]
fn search_avx512<I: Intersector>(
    accelerator: &Accelerator<'_>,
    ray: &Ray,
    range: Range<f64>,
    workspace: &mut Workspace,
    collector: &mut impl Collector,
) {
    accelerator.search_with::<I>(ray, range, workspace, collector);
}
