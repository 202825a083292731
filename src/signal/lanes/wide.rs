//! Eight lanes in the registers of the machine, chosen at run time.
#![allow(unsafe_code, reason = "checked vector instructions")]

use super::{LANES, Lanes, Real};

/// Eight lanes as a kernel computes with them.
pub trait Wide: Real {
    /// The register as integers.
    type Bits: Bits;
    /// From memory.
    fn load(lanes: &Lanes) -> Self;
    /// To memory.
    fn store(self, lanes: &mut Lanes);
    /// The numbers that have this binary representation.
    fn from_bits(bits: Self::Bits) -> Self;
    /// Their binary representation.
    fn to_bits(self) -> Self::Bits;
}

/// Eight integers of 64 bits.
pub trait Bits: Copy {
    /// From memory.
    fn load(lanes: &[u64; LANES]) -> Self;
    /// To memory.
    fn store(self, lanes: &mut [u64; LANES]);
    /// One value in every lane.
    #[inline(always)]
    fn splat(value: u64) -> Self {
        Self::load(&[value; LANES])
    }
    /// Sum modulo 2^64.
    fn add(self, other: Self) -> Self;
    /// Bitwise and.
    fn and(self, other: Self) -> Self;
    /// Bitwise or.
    fn or(self, other: Self) -> Self;
    /// Bitwise exclusive or.
    fn xor(self, other: Self) -> Self;
    /// Shifted left by these counts < 64.
    fn shl_each(self, counts: Self) -> Self;
    /// Shifted right by these counts < 64, zeros from the left.
    fn shr_each(self, counts: Self) -> Self;
    /// Shifted left by `count` < 64 bits.
    #[inline(always)]
    fn shl(self, count: u64) -> Self {
        self.shl_each(Self::splat(count))
    }
    /// Shifted right by `count` < 64 bits, zeros from the left.
    #[inline(always)]
    fn shr(self, count: u64) -> Self {
        self.shr_each(Self::splat(count))
    }
}

impl Wide for Lanes {
    type Bits = [u64; LANES];
    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        *lanes
    }
    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        *lanes = self;
    }
    #[inline(always)]
    fn from_bits(bits: [u64; LANES]) -> Self {
        Self(bits.map(f64::from_bits))
    }
    #[inline(always)]
    fn to_bits(self) -> [u64; LANES] {
        self.0.map(f64::to_bits)
    }
}

macro_rules! lane_integer_operator {
    ($method:ident, $operator:expr) => {
        #[inline(always)]
        fn $method(mut self, other: Self) -> Self {
            for i in 0..LANES {
                self[i] = $operator(self[i], other[i]);
            }
            self
        }
    };
}

impl Bits for [u64; LANES] {
    #[inline(always)]
    fn load(lanes: &[u64; LANES]) -> Self {
        *lanes
    }
    #[inline(always)]
    fn store(self, lanes: &mut [u64; LANES]) {
        *lanes = self;
    }
    lane_integer_operator!(add, u64::wrapping_add);
    lane_integer_operator!(and, |x, y| x & y);
    lane_integer_operator!(or, |x, y| x | y);
    lane_integer_operator!(xor, |x, y| x ^ y);
    lane_integer_operator!(shl_each, |x: u64, count| x << count);
    lane_integer_operator!(shr_each, |x: u64, count| x >> count);
}

/// Vector instructions of the processor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Level {
    /// Whatever the compiler makes of plain arrays.
    Portable,
    /// Two registers of four, fused multiply-add.
    Avx2,
    /// One register of eight, fused multiply-add.
    Avx512,
}

impl Level {
    /// The best of this machine.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            // AVX-512VL beside F: the compiler may then use narrower registers of that set in the same
            // kernel.
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Self::Avx2;
            }
        }
        Self::Portable
    }

    /// Returns true if this machine supports it.
    #[cfg(target_arch = "x86_64")]
    fn is_here(self) -> bool {
        self as u8 <= Self::best() as u8
    }
}

impl std::fmt::Display for Level {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Portable => "none used (portable)",
            Self::Avx2 => "AVX2 + FMA",
            Self::Avx512 => "AVX-512",
        })
    }
}

/// A computation written for any width. `run` and all it calls must be `#[inline(always)]`, loops rather
/// than closures or `array::map`: what is not inlined into the dispatching function is not compiled for
/// the wider units (a factor of four from one `map`, seen in the profile).
pub trait Kernel {
    /// Result of the computation.
    type Output;
    /// Computes with registers of type `W`.
    fn run<W: Wide>(self) -> Self::Output;
}

/// Runs a kernel at a level, or portably where the machine does not have it.
pub fn dispatch<K: Kernel>(level: Level, kernel: K) -> K::Output {
    match level {
        // Safety: the processor has what the functions were compiled for.
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 if level.is_here() => unsafe { x86::avx512(kernel) },
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 if level.is_here() => unsafe { x86::avx2(kernel) },
        _ => kernel.run::<Lanes>(),
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    //! The register types are private to this module: they exist only inside the two functions below,
    //! whose caller has asked the processor. That is why every `unsafe` here is sound.

    use super::{Bits, Kernel, LANES, Lanes, Real, Wide};
    use crate::lanes::derived_operators;
    use std::arch::x86_64::*;
    use std::ops::{Add, Div, Mul, Neg, Sub};

    #[target_feature(enable = "avx512f,avx512vl")]
    pub(super) fn avx512<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx512>()
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn avx2<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx2>()
    }

    macro_rules! by_register {
        ($count:literal, $method:ident, $intrinsic:ident) => {
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for i in 0..$count {
                    self.0[i] = unsafe { $intrinsic(self.0[i], other.0[i]) };
                }
                self
            }
        };
    }

    macro_rules! operator {
        ($name:ident, $count:literal, $trait:ident, $method:ident, $intrinsic:ident) => {
            impl $trait for $name {
                type Output = Self;
                by_register!($count, $method, $intrinsic);
            }
        };
    }

    /// Eight integers in `$count` registers of `$width` lanes.
    macro_rules! wide_integers {
        ($name:ident, $register:ident, $count:literal, $width:literal, $load:ident, $store:ident,
         $add:ident, $and:ident, $or:ident, $xor:ident, $shl:ident, $shr:ident) => {
            #[derive(Clone, Copy)]
            struct $name([$register; $count]);
            impl Bits for $name {
                #[inline(always)]
                fn load(lanes: &[u64; LANES]) -> Self {
                    Self(std::array::from_fn(|i| unsafe {
                        $load(lanes.as_ptr().add($width * i).cast())
                    }))
                }
                #[inline(always)]
                fn store(self, lanes: &mut [u64; LANES]) {
                    for i in 0..$count {
                        unsafe { $store(lanes.as_mut_ptr().add($width * i).cast(), self.0[i]) };
                    }
                }
                by_register!($count, add, $add);
                by_register!($count, and, $and);
                by_register!($count, or, $or);
                by_register!($count, xor, $xor);
                by_register!($count, shl_each, $shl);
                by_register!($count, shr_each, $shr);
            }
        };
    }

    /// Eight lanes in `$count` registers of `$width` lanes.
    macro_rules! wide {
        ($name:ident, $bits:ident, $register:ident, $count:literal, $width:literal, $set:ident, $load:ident, $store:ident,
         $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $fma:ident, $to_bits:ident, $from_bits:ident) => {
            #[derive(Clone, Copy)]
            struct $name([$register; $count]);
            operator!($name, $count, Add, add, $add);
            operator!($name, $count, Sub, sub, $sub);
            operator!($name, $count, Mul, mul, $mul);
            operator!($name, $count, Div, div, $div);
            derived_operators!($name);
            impl From<f64> for $name {
                #[inline(always)]
                fn from(value: f64) -> Self {
                    Self(unsafe { [$set(value); $count] })
                }
            }
            impl Neg for $name {
                type Output = Self;
                #[inline(always)]
                fn neg(self) -> Self {
                    // −0 − x is −x for x = ±0 as well; 0 − x would lose the sign of a zero.
                    Self::from(-0.0) - self
                }
            }
            impl Real for $name {
                #[inline(always)]
                fn sqrt(mut self) -> Self {
                    for i in 0..$count {
                        self.0[i] = unsafe { $sqrt(self.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn mul_add(mut self, factor: Self, term: Self) -> Self {
                    for i in 0..$count {
                        self.0[i] = unsafe { $fma(self.0[i], factor.0[i], term.0[i]) };
                    }
                    self
                }
            }
            impl Wide for $name {
                type Bits = $bits;
                #[inline(always)]
                fn from_bits(bits: $bits) -> Self {
                    Self(bits.0.map(|register| unsafe { $from_bits(register) }))
                }
                #[inline(always)]
                fn to_bits(self) -> $bits {
                    $bits(self.0.map(|register| unsafe { $to_bits(register) }))
                }
                #[inline(always)]
                fn load(lanes: &Lanes) -> Self {
                    let mut result = Self::from(0.0);
                    for i in 0..$count {
                        // Lanes is aligned to 64 bytes and eight values long
                        result.0[i] = unsafe { $load(lanes.0.as_ptr().add($width * i)) };
                    }
                    result
                }
                #[inline(always)]
                fn store(self, lanes: &mut Lanes) {
                    for i in 0..$count {
                        unsafe { $store(lanes.0.as_mut_ptr().add($width * i), self.0[i]) };
                    }
                }
            }
        };
    }

    wide_integers!(
        Avx512Bits,
        __m512i,
        1,
        8,
        _mm512_loadu_si512,
        _mm512_storeu_si512,
        _mm512_add_epi64,
        _mm512_and_si512,
        _mm512_or_si512,
        _mm512_xor_si512,
        _mm512_sllv_epi64,
        _mm512_srlv_epi64
    );
    wide_integers!(
        Avx2Bits,
        __m256i,
        2,
        4,
        _mm256_loadu_si256,
        _mm256_storeu_si256,
        _mm256_add_epi64,
        _mm256_and_si256,
        _mm256_or_si256,
        _mm256_xor_si256,
        _mm256_sllv_epi64,
        _mm256_srlv_epi64
    );
    wide!(
        Avx512,
        Avx512Bits,
        __m512d,
        1,
        8,
        _mm512_set1_pd,
        _mm512_load_pd,
        _mm512_store_pd,
        _mm512_add_pd,
        _mm512_sub_pd,
        _mm512_mul_pd,
        _mm512_div_pd,
        _mm512_sqrt_pd,
        _mm512_fmadd_pd,
        _mm512_castpd_si512,
        _mm512_castsi512_pd
    );
    wide!(
        Avx2,
        Avx2Bits,
        __m256d,
        2,
        4,
        _mm256_set1_pd,
        _mm256_load_pd,
        _mm256_store_pd,
        _mm256_add_pd,
        _mm256_sub_pd,
        _mm256_mul_pd,
        _mm256_div_pd,
        _mm256_sqrt_pd,
        _mm256_fmadd_pd,
        _mm256_castpd_si256,
        _mm256_castsi256_pd
    );
}
