//! Sixteen rays at a time, with the instructions of the processor at hand.
//!
//! Kernels are written once, for any [`Simd`]; [`Instructions::run`] compiles a task for each
//! set of instructions and calls the one that was chosen at run time.

#[cfg(target_arch = "x86_64")]
mod x86;

use wide::{f32x4, f64x2};

/// Numbers side by side in single precision.
pub(crate) const LANES: usize = 16;

/// Numbers side by side in double precision.
pub(crate) const WIDE_LANES: usize = 8;

/// A set of processor instructions that the program has kernels for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// Sixteen numbers at once, and fused multiplication and addition.
    Avx512,
    /// Eight numbers at once, and fused multiplication and addition.
    Avx2,
    /// What every processor has.
    Portable,
}

impl Instructions {
    /// All sets, the widest first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Portable];

    /// The widest set of this processor.
    pub fn best() -> Self {
        let available = Self::ALL.into_iter().find(|set| set.is_available());
        available.unwrap_or(Self::Portable)
    }

    /// Whether this processor has the set.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::is_available(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Portable => true,
        }
    }

    /// The name in messages and statistics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2",
            Self::Portable => "portable",
        }
    }

    /// Runs a task with these instructions, or with the portable ones where they are missing.
    #[inline(always)]
    pub(crate) fn run<T: Task>(self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        {
            if self == Self::Avx512
                && let Some(set) = pulp::x86::V4::try_new()
            {
                return set.vectorize(x86::Call(set, task));
            }
            if self == Self::Avx2
                && let Some(set) = pulp::x86::V3::try_new()
            {
                return set.vectorize(x86::Call(set, task));
            }
        }
        portable(task)
    }
}

/// In a frame of its own, which the other sets of instructions do without: unoptimised it is large.
#[inline(never)]
fn portable<T: Task>(task: T) -> T::Output {
    task.run(Portable)
}

/// Work that is compiled for each set of instructions. All that it calls must be inlined.
pub(crate) trait Task {
    type Output;

    fn run<S: Simd>(self, s: S) -> Self::Output;
}

/// A part of a task that is compiled as a function of its own, with the instructions of the task:
/// what comes in large portions. A single function of all takes the compiler many times as long.
pub(crate) trait Part<S> {
    type Output;

    fn run(self, s: S) -> Self::Output;
}

/// Arithmetic in single precision on lanes, all [`LANES`] or the first of them. Comparisons with what
/// is not a number are false.
pub(crate) trait Singles: Copy {
    /// How many lanes there are: of an array the first ones are loaded, and stored to.
    const COUNT: usize = LANES;

    /// A number for each.
    type F: Copy;
    /// A yes or no for each.
    type M: Copy;

    fn apart<P: Part<Self>>(self, part: P) -> P::Output;

    fn splat(self, x: f32) -> Self::F;
    fn load(self, from: &[f32; LANES]) -> Self::F;
    fn store(self, x: Self::F, to: &mut [f32; LANES]);
    /// Half as many, and zeros beside them.
    #[inline(always)]
    fn load_half(self, from: &[f32; WIDE_LANES]) -> Self::F {
        self.load(&pulp::cast([*from, [0.0; WIDE_LANES]]))
    }
    /// Of the first half.
    #[inline(always)]
    fn store_half(self, x: Self::F, to: &mut [f32; WIDE_LANES]) {
        let mut all = [0.0; LANES];
        self.store(x, &mut all);
        to.copy_from_slice(&all[..WIDE_LANES]);
    }
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a b + c`.
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `c - a b`.
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// The lesser; `b` where one is not a number.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// The greater; `b` where one is not a number.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    fn abs(self, a: Self::F) -> Self::F;
    fn sqrt(self, a: Self::F) -> Self::F;
    fn lt(self, a: Self::F, b: Self::F) -> Self::M;
    fn le(self, a: Self::F, b: Self::F) -> Self::M;
    /// One bit for each lane, the first lowest.
    fn bits(self, mask: Self::M) -> u32;
}

/// Arithmetic on lanes.
pub(crate) trait Simd: Singles {
    /// [`WIDE_LANES`] numbers in double precision.
    type D: Copy;
    /// The same with half of the lanes, or with all where that is no slower.
    type Half: Singles;

    fn half(self) -> Self::Half;

    fn splat_d(self, x: f64) -> Self::D;
    fn load_d(self, from: &[f64; WIDE_LANES]) -> Self::D;
    fn store_d(self, x: Self::D, to: &mut [f64; WIDE_LANES]);
    /// Rounds to single precision.
    fn store_rounded(self, x: Self::D, to: &mut [f32; WIDE_LANES]);
    fn add_d(self, a: Self::D, b: Self::D) -> Self::D;
    fn sub_d(self, a: Self::D, b: Self::D) -> Self::D;
    /// The lesser; `b` where one is not a number.
    fn min_d(self, a: Self::D, b: Self::D) -> Self::D;
    /// The greater; `b` where one is not a number.
    fn max_d(self, a: Self::D, b: Self::D) -> Self::D;
    fn mul_d(self, a: Self::D, b: Self::D) -> Self::D;
    fn div_d(self, a: Self::D, b: Self::D) -> Self::D;
    /// `a b + c`.
    fn fma_d(self, a: Self::D, b: Self::D, c: Self::D) -> Self::D;
    /// `c - a b`.
    fn fnma_d(self, a: Self::D, b: Self::D, c: Self::D) -> Self::D;
    fn abs_d(self, a: Self::D) -> Self::D;
    fn sqrt_d(self, a: Self::D) -> Self::D;
    /// A bit for each lane in which `a < b`.
    fn lt_d(self, a: Self::D, b: Self::D) -> u32;
}

/// A number for all lanes, or one for each.
pub(crate) trait PerLane<S> {
    type Lanes;

    /// What each lane holds.
    fn lanes(&self, s: S) -> Self::Lanes;
}

impl<S: Singles> PerLane<S> for f32 {
    type Lanes = S::F;

    #[inline(always)]
    fn lanes(&self, s: S) -> S::F {
        s.splat(*self)
    }
}

impl<S: Singles> PerLane<S> for [f32; LANES] {
    type Lanes = S::F;

    #[inline(always)]
    fn lanes(&self, s: S) -> S::F {
        s.load(self)
    }
}

impl<S: Simd> PerLane<S> for f64 {
    type Lanes = S::D;

    #[inline(always)]
    fn lanes(&self, s: S) -> S::D {
        s.splat_d(*self)
    }
}

impl<S: Simd> PerLane<S> for [f64; WIDE_LANES] {
    type Lanes = S::D;

    #[inline(always)]
    fn lanes(&self, s: S) -> S::D {
        s.load_d(self)
    }
}

/// What every processor of its kind has, four numbers at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

/// Applies an operation to the parts of its arguments, one by one.
macro_rules! parts {
    ($a:ident => $e:expr) => {{
        let $a = $a;
        [
            {
                let $a = $a[0];
                $e
            },
            {
                let $a = $a[1];
                $e
            },
            {
                let $a = $a[2];
                $e
            },
            {
                let $a = $a[3];
                $e
            },
        ]
    }};
    ($a:ident, $b:ident => $e:expr) => {
        [
            {
                let ($a, $b) = ($a[0], $b[0]);
                $e
            },
            {
                let ($a, $b) = ($a[1], $b[1]);
                $e
            },
            {
                let ($a, $b) = ($a[2], $b[2]);
                $e
            },
            {
                let ($a, $b) = ($a[3], $b[3]);
                $e
            },
        ]
    };
    ($a:ident, $b:ident, $c:ident => $e:expr) => {
        [
            {
                let ($a, $b, $c) = ($a[0], $b[0], $c[0]);
                $e
            },
            {
                let ($a, $b, $c) = ($a[1], $b[1], $c[1]);
                $e
            },
            {
                let ($a, $b, $c) = ($a[2], $b[2], $c[2]);
                $e
            },
            {
                let ($a, $b, $c) = ($a[3], $b[3], $c[3]);
                $e
            },
        ]
    };
}

impl Singles for Portable {
    type F = [f32x4; 4];
    type M = [f32x4; 4];

    #[inline(never)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        part.run(self)
    }

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F {
        [f32x4::splat(x); 4]
    }
    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> Self::F {
        pulp::cast(*from)
    }
    #[inline(always)]
    fn store(self, x: Self::F, to: &mut [f32; LANES]) {
        *to = pulp::cast(x);
    }
    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        parts!(a, b => a + b)
    }
    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        parts!(a, b => a - b)
    }
    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        parts!(a, b => a * b)
    }
    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        parts!(a, b => a / b)
    }
    #[inline(always)]
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        parts!(a, b, c => a * b + c)
    }
    #[inline(always)]
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        parts!(a, b, c => c - a * b)
    }
    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        parts!(a, b => a.fast_min(b))
    }
    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        parts!(a, b => a.fast_max(b))
    }
    #[inline(always)]
    fn abs(self, a: Self::F) -> Self::F {
        parts!(a => a.abs())
    }
    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        parts!(a => a.sqrt())
    }
    #[inline(always)]
    fn lt(self, a: Self::F, b: Self::F) -> Self::M {
        parts!(a, b => a.simd_lt(b))
    }
    #[inline(always)]
    fn le(self, a: Self::F, b: Self::F) -> Self::M {
        parts!(a, b => a.simd_le(b))
    }
    #[inline(always)]
    fn bits(self, mask: Self::M) -> u32 {
        let [a, b, c, d] = parts!(mask => mask.to_bitmask());
        a | b << 4 | c << 8 | d << 12
    }
}

impl Simd for Portable {
    type D = [f64x2; 4];
    type Half = Self;

    #[inline(always)]
    fn half(self) -> Self {
        self
    }
    #[inline(always)]
    fn splat_d(self, x: f64) -> Self::D {
        [f64x2::splat(x); 4]
    }
    #[inline(always)]
    fn load_d(self, from: &[f64; WIDE_LANES]) -> Self::D {
        pulp::cast(*from)
    }
    #[inline(always)]
    fn store_d(self, x: Self::D, to: &mut [f64; WIDE_LANES]) {
        *to = pulp::cast(x);
    }
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is what it does")]
    fn store_rounded(self, x: Self::D, to: &mut [f32; WIDE_LANES]) {
        let all: [f64; WIDE_LANES] = pulp::cast(x);
        *to = all.map(|x| x as f32);
    }
    #[inline(always)]
    fn add_d(self, a: Self::D, b: Self::D) -> Self::D {
        parts!(a, b => a + b)
    }
    #[inline(always)]
    fn min_d(self, a: Self::D, b: Self::D) -> Self::D {
        parts!(a, b => a.fast_min(b))
    }
    #[inline(always)]
    fn max_d(self, a: Self::D, b: Self::D) -> Self::D {
        parts!(a, b => a.fast_max(b))
    }
    #[inline(always)]
    fn sub_d(self, a: Self::D, b: Self::D) -> Self::D {
        parts!(a, b => a - b)
    }
    #[inline(always)]
    fn mul_d(self, a: Self::D, b: Self::D) -> Self::D {
        parts!(a, b => a * b)
    }
    #[inline(always)]
    fn div_d(self, a: Self::D, b: Self::D) -> Self::D {
        parts!(a, b => a / b)
    }
    #[inline(always)]
    fn fma_d(self, a: Self::D, b: Self::D, c: Self::D) -> Self::D {
        parts!(a, b, c => a * b + c)
    }
    #[inline(always)]
    fn fnma_d(self, a: Self::D, b: Self::D, c: Self::D) -> Self::D {
        parts!(a, b, c => c - a * b)
    }
    #[inline(always)]
    fn abs_d(self, a: Self::D) -> Self::D {
        parts!(a => a.abs())
    }
    #[inline(always)]
    fn sqrt_d(self, a: Self::D) -> Self::D {
        parts!(a => a.sqrt())
    }
    #[inline(always)]
    fn lt_d(self, a: Self::D, b: Self::D) -> u32 {
        let [a, b, c, d] = parts!(a, b => a.simd_lt(b).to_bitmask());
        a | b << 2 | c << 4 | d << 6
    }
}
