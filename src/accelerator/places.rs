//! Points and normals in the world of what a packet has met, eight rays at a time.

use glam::DVec3;
use kernel::MAX_DEGREE;

use super::Instance;
use super::beam::RAYS;
use super::finish::Roots;
use crate::simd::{Simd, WIDE_LANES};

/// Square of the sine of the derivatives, and of the ratio of their lengths, above which a normal
/// is surely regular.
const PLAIN: f64 = 1e-8;

/// A derivative shorter than this share of what its terms can be may be mostly rounding.
const ROUNDING: f64 = 1e4 * f64::EPSILON * MAX_DEGREE as f64;

/// Squares between these are neither lost nor endless.
const SQUARES: [f64; 2] = [1e-280, 1e280];

/// Three coordinates for each ray.
type Vectors = [[f64; RAYS]; 3];

/// Where rays have met pieces.
#[derive(Debug)]
pub(super) struct Places {
    /// A bit for each ray of which what follows is known.
    known: u64,
    /// The point: in the cluster, then in the world.
    point: Vectors,
    /// Derivatives in the cluster by the parameters of the piece, in its units.
    by_u: Vectors,
    by_v: Vectors,
    /// The unit normal in the world.
    normal: Vectors,
    maps: Maps,
}

/// How the clusters of eight rays stand in the world.
#[derive(Debug)]
struct Maps {
    instance: [u32; WIDE_LANES],
    /// Three axes and the origin.
    axes: [[[f64; WIDE_LANES]; 3]; 4],
    stretch: [f64; WIDE_LANES],
}

impl Maps {
    const NONE: Self = Self {
        instance: [u32::MAX; WIDE_LANES],
        axes: [[[0.0; WIDE_LANES]; 3]; 4],
        stretch: [0.0; WIDE_LANES],
    };

    #[inline(always)]
    fn gather(&mut self, numbers: &[u32; WIDE_LANES], instances: &[Instance]) {
        if self.instance == *numbers {
            return;
        }
        for (k, &number) in numbers.iter().enumerate() {
            if self.instance[k] == number {
                continue;
            }
            let instance = &instances[number as usize];
            let map = &instance.world_from_cluster;
            let axes = [
                map.matrix3.x_axis,
                map.matrix3.y_axis,
                map.matrix3.z_axis,
                map.translation,
            ];
            for (to, from) in self.axes.iter_mut().zip(axes) {
                (to[0][k], to[1][k], to[2][k]) = (from.x, from.y, from.z);
            }
            self.stretch[k] = instance.stretch;
            self.instance[k] = number;
        }
    }

    /// Vectors in the world.
    #[inline(always)]
    fn turned<S: Simd>(&self, s: S, [x, y, z]: [S::D; 3]) -> [S::D; 3] {
        let [a, b, c, _] = &self.axes;
        let mut turned = [x, y, z];
        for r in 0..3 {
            let rest = s.fma_d(s.load_d(&b[r]), y, s.mul_d(s.load_d(&c[r]), z));
            turned[r] = s.fma_d(s.load_d(&a[r]), x, rest);
        }
        turned
    }
}

/// Eight lanes of vectors.
#[inline(always)]
fn load<S: Simd>(s: S, [x, y, z]: &Vectors, group: usize) -> [S::D; 3] {
    [
        s.load_d(&x.as_chunks().0[group]),
        s.load_d(&y.as_chunks().0[group]),
        s.load_d(&z.as_chunks().0[group]),
    ]
}

#[inline(always)]
fn store<S: Simd>(s: S, values: [S::D; 3], vectors: &mut Vectors, group: usize) {
    for r in 0..3 {
        s.store_d(values[r], &mut vectors[r].as_chunks_mut().0[group]);
    }
}

#[inline(always)]
fn dot<S: Simd>(s: S, a: [S::D; 3], b: [S::D; 3]) -> S::D {
    s.fma_d(a[0], b[0], s.fma_d(a[1], b[1], s.mul_d(a[2], b[2])))
}

/// `a x b`.
#[inline(always)]
fn cross<S: Simd>(s: S, a: [S::D; 3], b: [S::D; 3]) -> [S::D; 3] {
    [
        s.fnma_d(a[2], b[1], s.mul_d(a[1], b[2])),
        s.fnma_d(a[0], b[2], s.mul_d(a[2], b[0])),
        s.fnma_d(a[1], b[0], s.mul_d(a[0], b[1])),
    ]
}

impl Places {
    pub(super) const NONE: Self = Self {
        known: 0,
        point: [[0.0; RAYS]; 3],
        by_u: [[0.0; RAYS]; 3],
        by_v: [[0.0; RAYS]; 3],
        normal: [[0.0; RAYS]; 3],
        maps: Maps::NONE,
    };

    /// Begins with a packet, perhaps of another scene.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.known = 0;
        self.maps.instance = [u32::MAX; WIDE_LANES];
    }

    /// Takes point and derivatives of a ray, or forgets what was known.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, place: Option<[DVec3; 3]>) {
        self.known &= !(1 << lane);
        let Some([point, by_u, by_v]) = place else {
            return;
        };
        self.known |= 1 << lane;
        for r in 0..3 {
            self.point[r][lane] = point[r];
            self.by_u[r][lane] = by_u[r];
            self.by_v[r][lane] = by_v[r];
        }
    }

    /// As [`Self::set`], for the rays of eight: points are `center` and `radius` times those
    /// given.
    #[inline(always)]
    pub(super) fn set_eight(
        &mut self,
        eight: usize,
        (center, radius): (DVec3, f64),
        roots: &Roots,
    ) {
        self.known |= 0xff << (eight * WIDE_LANES);
        for r in 0..3 {
            let to = &mut self.point[r].as_chunks_mut::<WIDE_LANES>().0[eight];
            for (to, from) in to.iter_mut().zip(&roots.point[r]) {
                *to = center[r] + from * radius;
            }
            self.by_u[r].as_chunks_mut().0[eight] = roots.by_u[r];
            self.by_v[r].as_chunks_mut().0[eight] = roots.by_v[r];
        }
    }

    /// Brings points to the world and finds normals; what is not surely regular is left out.
    #[inline(always)]
    pub(super) fn complete<S: Simd>(
        &mut self,
        s: S,
        numbers: &[u32; RAYS],
        instances: &[Instance],
    ) {
        let mut regular = 0;
        for (group, numbers) in numbers.as_chunks().0.iter().enumerate() {
            let [lanes, ..] = (self.known >> (group * WIDE_LANES)).to_le_bytes();
            if lanes == 0 {
                continue;
            }
            self.maps.gather(numbers, instances);
            let maps = &self.maps;
            let mut point = maps.turned(s, load(s, &self.point, group));
            for (part, origin) in point.iter_mut().zip(&maps.axes[3]) {
                *part = s.add_d(*part, s.load_d(origin));
            }
            let by_u = maps.turned(s, load(s, &self.by_u, group));
            let by_v = maps.turned(s, load(s, &self.by_v, group));
            let mut normal = cross(s, by_u, by_v);
            let (square_u, square_v) = (dot(s, by_u, by_u), dot(s, by_v, by_v));
            let square = dot(s, normal, normal);
            let least = s.mul_d(s.splat_d(ROUNDING), s.load_d(&maps.stretch));
            let least = s.mul_d(least, least);
            let plain = s.splat_d(PLAIN);
            let bits = s.lt_d(s.mul_d(plain, s.mul_d(square_u, square_v)), square)
                & s.lt_d(s.mul_d(plain, square_u), square_v)
                & s.lt_d(s.mul_d(plain, square_v), square_u)
                & s.lt_d(least, square_u)
                & s.lt_d(least, square_v)
                & s.lt_d(s.splat_d(SQUARES[0]), square)
                & s.lt_d(square, s.splat_d(SQUARES[1]));
            regular |= u64::from(bits & u32::from(lanes)) << (group * WIDE_LANES);
            let inverse = s.div_d(s.splat_d(1.0), s.sqrt_d(square));
            for part in &mut normal {
                *part = s.mul_d(*part, inverse);
            }
            store(s, point, &mut self.point, group);
            store(s, normal, &mut self.normal, group);
        }
        self.known = regular;
    }

    /// Point and normal in the world of what a ray has met, where they are known.
    #[inline(always)]
    pub(super) fn of(&self, lane: usize) -> Option<[DVec3; 2]> {
        let vector = |v: &Vectors| DVec3::new(v[0][lane], v[1][lane], v[2][lane]);
        (self.known >> lane & 1 == 1).then(|| [vector(&self.point), vector(&self.normal)])
    }
}
