//! AVX-512 and AVX2 with FMA, through safe wrappers of the instructions.

use core::arch::x86_64::{__m256, __m256d, __m512, __m512d};

use pulp::NullaryFnOnce;
use pulp::x86::{V3, V4};

use super::{LANES, Part, Simd, Singles, Task, WIDE_LANES};

/// "Less than", false for what is not a number.
const LESS: i32 = 17;

/// "Less or equal", false for what is not a number.
const LESS_OR_EQUAL: i32 = 18;

/// A task with its instructions.
pub(super) struct Call<S, T>(pub(super) S, pub(super) T);

impl<S: Simd, T: Task> NullaryFnOnce for Call<S, T> {
    type Output = T::Output;

    #[inline(always)]
    fn call(self) -> T::Output {
        self.1.run(self.0)
    }
}

/// A part of a task with its instructions.
struct Apart<S, P>(S, P);

impl<S, P: Part<S>> NullaryFnOnce for Apart<S, P> {
    type Output = P::Output;

    #[inline(always)]
    fn call(self) -> P::Output {
        self.1.run(self.0)
    }
}

impl Singles for V4 {
    type F = __m512;
    type M = u16;

    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        self.vectorize(Apart(self, part))
    }

    #[inline(always)]
    fn splat(self, x: f32) -> __m512 {
        self.avx512f._mm512_set1_ps(x)
    }
    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> __m512 {
        pulp::cast(*from)
    }
    #[inline(always)]
    fn store(self, x: __m512, to: &mut [f32; LANES]) {
        *to = pulp::cast(x);
    }
    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        self.avx512f._mm512_add_ps(a, b)
    }
    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        self.avx512f._mm512_sub_ps(a, b)
    }
    #[inline(always)]
    fn mul(self, a: __m512, b: __m512) -> __m512 {
        self.avx512f._mm512_mul_ps(a, b)
    }
    #[inline(always)]
    fn div(self, a: __m512, b: __m512) -> __m512 {
        self.avx512f._mm512_div_ps(a, b)
    }
    #[inline(always)]
    fn fma(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        self.avx512f._mm512_fmadd_ps(a, b, c)
    }
    #[inline(always)]
    fn fnma(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        self.avx512f._mm512_fnmadd_ps(a, b, c)
    }
    #[inline(always)]
    fn min(self, a: __m512, b: __m512) -> __m512 {
        self.avx512f._mm512_min_ps(a, b)
    }
    #[inline(always)]
    fn max(self, a: __m512, b: __m512) -> __m512 {
        self.avx512f._mm512_max_ps(a, b)
    }
    #[inline(always)]
    fn abs(self, a: __m512) -> __m512 {
        self.avx512f._mm512_abs_ps(a)
    }
    #[inline(always)]
    fn sqrt(self, a: __m512) -> __m512 {
        self.avx512f._mm512_sqrt_ps(a)
    }
    #[inline(always)]
    fn lt(self, a: __m512, b: __m512) -> u16 {
        self.avx512f._mm512_cmp_ps_mask::<LESS>(a, b)
    }
    #[inline(always)]
    fn le(self, a: __m512, b: __m512) -> u16 {
        self.avx512f._mm512_cmp_ps_mask::<LESS_OR_EQUAL>(a, b)
    }
    #[inline(always)]
    fn bits(self, mask: u16) -> u32 {
        u32::from(mask)
    }
}

impl Simd for V4 {
    type D = __m512d;
    type Half = Self;

    #[inline(always)]
    fn half(self) -> Self {
        self
    }
    #[inline(always)]
    fn splat_d(self, x: f64) -> __m512d {
        self.avx512f._mm512_set1_pd(x)
    }
    #[inline(always)]
    fn load_d(self, from: &[f64; WIDE_LANES]) -> __m512d {
        pulp::cast(*from)
    }
    #[inline(always)]
    fn store_d(self, x: __m512d, to: &mut [f64; WIDE_LANES]) {
        *to = pulp::cast(x);
    }
    #[inline(always)]
    fn store_rounded(self, x: __m512d, to: &mut [f32; WIDE_LANES]) {
        *to = pulp::cast(self.avx512f._mm512_cvtpd_ps(x));
    }
    #[inline(always)]
    fn add_d(self, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_add_pd(a, b)
    }
    #[inline(always)]
    fn min_d(self, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_min_pd(a, b)
    }
    #[inline(always)]
    fn max_d(self, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_max_pd(a, b)
    }
    #[inline(always)]
    fn sub_d(self, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_sub_pd(a, b)
    }
    #[inline(always)]
    fn mul_d(self, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_mul_pd(a, b)
    }
    #[inline(always)]
    fn div_d(self, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_div_pd(a, b)
    }
    #[inline(always)]
    fn fma_d(self, a: __m512d, b: __m512d, c: __m512d) -> __m512d {
        self.avx512f._mm512_fmadd_pd(a, b, c)
    }
    #[inline(always)]
    fn fnma_d(self, a: __m512d, b: __m512d, c: __m512d) -> __m512d {
        self.avx512f._mm512_fnmadd_pd(a, b, c)
    }
    #[inline(always)]
    fn abs_d(self, a: __m512d) -> __m512d {
        self.avx512f._mm512_abs_pd(a)
    }
    #[inline(always)]
    fn sqrt_d(self, a: __m512d) -> __m512d {
        self.avx512f._mm512_sqrt_pd(a)
    }
    #[inline(always)]
    fn lt_d(self, a: __m512d, b: __m512d) -> u32 {
        u32::from(self.avx512f._mm512_cmp_pd_mask::<LESS>(a, b))
    }
}

/// The instructions of AVX2, for half of the lanes.
#[derive(Clone, Copy)]
pub(crate) struct Eight(V3);

impl Singles for Eight {
    const COUNT: usize = WIDE_LANES;

    type F = __m256;
    type M = __m256;

    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        self.0.vectorize(Apart(self, part))
    }

    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        self.0.avx._mm256_set1_ps(x)
    }
    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> __m256 {
        let [low, _]: [__m256; 2] = pulp::cast(*from);
        low
    }
    #[inline(always)]
    fn store(self, x: __m256, to: &mut [f32; LANES]) {
        to.as_chunks_mut::<WIDE_LANES>().0[0] = pulp::cast(x);
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_add_ps(a, b)
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_sub_ps(a, b)
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_mul_ps(a, b)
    }
    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_div_ps(a, b)
    }
    #[inline(always)]
    fn fma(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        self.0.fma._mm256_fmadd_ps(a, b, c)
    }
    #[inline(always)]
    fn fnma(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        self.0.fma._mm256_fnmadd_ps(a, b, c)
    }
    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_min_ps(a, b)
    }
    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_max_ps(a, b)
    }
    #[inline(always)]
    fn abs(self, a: __m256) -> __m256 {
        let sign = self.splat(-0.0);
        self.0.avx._mm256_andnot_ps(sign, a)
    }
    #[inline(always)]
    fn sqrt(self, a: __m256) -> __m256 {
        self.0.avx._mm256_sqrt_ps(a)
    }
    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_cmp_ps::<LESS>(a, b)
    }
    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> __m256 {
        self.0.avx._mm256_cmp_ps::<LESS_OR_EQUAL>(a, b)
    }
    #[inline(always)]
    fn bits(self, mask: __m256) -> u32 {
        self.0.avx._mm256_movemask_ps(mask).cast_unsigned()
    }
}

impl Singles for V3 {
    type F = [__m256; 2];
    type M = [__m256; 2];

    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        self.vectorize(Apart(self, part))
    }

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F {
        [self.half().splat(x); 2]
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
        let half = self.half();
        [half.add(a[0], b[0]), half.add(a[1], b[1])]
    }
    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        let half = self.half();
        [half.sub(a[0], b[0]), half.sub(a[1], b[1])]
    }
    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        let half = self.half();
        [half.mul(a[0], b[0]), half.mul(a[1], b[1])]
    }
    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        let half = self.half();
        [half.div(a[0], b[0]), half.div(a[1], b[1])]
    }
    #[inline(always)]
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        let half = self.half();
        [half.fma(a[0], b[0], c[0]), half.fma(a[1], b[1], c[1])]
    }
    #[inline(always)]
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        let half = self.half();
        [half.fnma(a[0], b[0], c[0]), half.fnma(a[1], b[1], c[1])]
    }
    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        let half = self.half();
        [half.min(a[0], b[0]), half.min(a[1], b[1])]
    }
    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        let half = self.half();
        [half.max(a[0], b[0]), half.max(a[1], b[1])]
    }
    #[inline(always)]
    fn abs(self, a: Self::F) -> Self::F {
        let half = self.half();
        [half.abs(a[0]), half.abs(a[1])]
    }
    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        let half = self.half();
        [half.sqrt(a[0]), half.sqrt(a[1])]
    }
    #[inline(always)]
    fn lt(self, a: Self::F, b: Self::F) -> Self::M {
        let half = self.half();
        [half.lt(a[0], b[0]), half.lt(a[1], b[1])]
    }
    #[inline(always)]
    fn le(self, a: Self::F, b: Self::F) -> Self::M {
        let half = self.half();
        [half.le(a[0], b[0]), half.le(a[1], b[1])]
    }
    #[inline(always)]
    fn bits(self, [low, high]: Self::M) -> u32 {
        let half = self.half();
        half.bits(low) | half.bits(high) << WIDE_LANES
    }
}

impl Simd for V3 {
    type D = [__m256d; 2];
    type Half = Eight;

    #[inline(always)]
    fn half(self) -> Eight {
        Eight(self)
    }

    #[inline(always)]
    fn splat_d(self, x: f64) -> Self::D {
        [self.avx._mm256_set1_pd(x); 2]
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
    fn store_rounded(self, x: Self::D, to: &mut [f32; WIDE_LANES]) {
        *to = pulp::cast(x.map(|half| self.avx._mm256_cvtpd_ps(half)));
    }
    #[inline(always)]
    fn add_d(self, a: Self::D, b: Self::D) -> Self::D {
        [
            self.avx._mm256_add_pd(a[0], b[0]),
            self.avx._mm256_add_pd(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn min_d(self, a: Self::D, b: Self::D) -> Self::D {
        [
            self.avx._mm256_min_pd(a[0], b[0]),
            self.avx._mm256_min_pd(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn max_d(self, a: Self::D, b: Self::D) -> Self::D {
        [
            self.avx._mm256_max_pd(a[0], b[0]),
            self.avx._mm256_max_pd(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn sub_d(self, a: Self::D, b: Self::D) -> Self::D {
        [
            self.avx._mm256_sub_pd(a[0], b[0]),
            self.avx._mm256_sub_pd(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn mul_d(self, a: Self::D, b: Self::D) -> Self::D {
        [
            self.avx._mm256_mul_pd(a[0], b[0]),
            self.avx._mm256_mul_pd(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn div_d(self, a: Self::D, b: Self::D) -> Self::D {
        [
            self.avx._mm256_div_pd(a[0], b[0]),
            self.avx._mm256_div_pd(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn fma_d(self, a: Self::D, b: Self::D, c: Self::D) -> Self::D {
        [
            self.fma._mm256_fmadd_pd(a[0], b[0], c[0]),
            self.fma._mm256_fmadd_pd(a[1], b[1], c[1]),
        ]
    }
    #[inline(always)]
    fn fnma_d(self, a: Self::D, b: Self::D, c: Self::D) -> Self::D {
        [
            self.fma._mm256_fnmadd_pd(a[0], b[0], c[0]),
            self.fma._mm256_fnmadd_pd(a[1], b[1], c[1]),
        ]
    }
    #[inline(always)]
    fn abs_d(self, a: Self::D) -> Self::D {
        let sign = self.avx._mm256_set1_pd(-0.0);
        [
            self.avx._mm256_andnot_pd(sign, a[0]),
            self.avx._mm256_andnot_pd(sign, a[1]),
        ]
    }
    #[inline(always)]
    fn sqrt_d(self, a: Self::D) -> Self::D {
        [self.avx._mm256_sqrt_pd(a[0]), self.avx._mm256_sqrt_pd(a[1])]
    }
    #[inline(always)]
    fn lt_d(self, a: Self::D, b: Self::D) -> u32 {
        let low = self.avx._mm256_cmp_pd::<LESS>(a[0], b[0]);
        let high = self.avx._mm256_cmp_pd::<LESS>(a[1], b[1]);
        let low = self.avx._mm256_movemask_pd(low).cast_unsigned();
        low | self.avx._mm256_movemask_pd(high).cast_unsigned() << 4
    }
}
