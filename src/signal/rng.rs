//! Random streams: every noise source of every run owns one, keyed by what it is, never by when or
//! where it is drawn. The same key gives the same numbers on any number of threads, lanes or shards.
//!
//! ```
//! use nav_sim_signal::noise::{Composite, Process, Synthesizer};
//! use nav_sim_signal::rng::StreamKey;
//!
//! let noise = Composite::new(vec![Process::white(4e-6)?]);
//! let key = StreamKey { seed: 1, scenario: "", run: 0, source: "gyro.x", process: "" };
//! let mut signals = [vec![0.0; 1 << 16], vec![0.0; 1 << 16]];
//! signals.iter_mut().for_each(|signal| Synthesizer::new(&noise, key).fill(signal));
//! assert_eq!(signals[0], signals[1]);
//! // The variance of 2^16 samples is known to √(2/2^16) = 0.55 %.
//! let variance = signals[0].iter().map(|x| x * x).sum::<f64>() / 65_536.0;
//! assert!((variance / 4e-6 - 1.0).abs() < 0.02);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::lanes::{Bits, LANES};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// The generator of the project: xoshiro256++ (fast, 256 bits of state, equidistributed).
pub type Generator = Xoshiro256PlusPlus;

/// Key of a random stream. Two keys that differ in any part give independent streams: the generator's
/// state is the BLAKE3 hash of the parts, each preceded by its length.
#[derive(Debug, Clone, Copy)]
pub struct StreamKey<'a> {
    /// The user's seed.
    pub seed: u64,
    /// Name of the truth scenario (empty when there is one only).
    pub scenario: &'a str,
    /// Monte-Carlo run, or replicate, counted from 0.
    pub run: u64,
    /// Noisy quantity: "accel.x", "gyro.z", "gnss.pos_n", "initial.att", …
    pub source: &'a str,
    /// Part of the noise: "WN", "AR1_2", "window", …
    pub process: &'a str,
}

impl StreamKey<'_> {
    /// The generator of a stream of the same run.
    pub fn stream(self, source: &str, process: &str) -> Generator {
        StreamKey {
            source,
            process,
            ..self
        }
        .generator()
    }

    /// The generator of this stream, at its beginning.
    pub fn generator(&self) -> Generator {
        Generator::from_seed(self.state())
    }

    /// The state of that generator: four words, little-endian.
    fn state(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher
            .update(&self.seed.to_le_bytes())
            .update(&self.run.to_le_bytes());
        for part in [self.scenario, self.source, self.process] {
            hasher
                .update(&(part.len() as u64).to_le_bytes())
                .update(part.as_bytes());
        }
        *hasher.finalize().as_bytes()
    }
}

/// Eight generators that advance together, each as [`Generator`] does.
#[derive(Debug, Clone)]
pub struct LaneGenerator {
    state: [[u64; LANES]; 4],
}

impl LaneGenerator {
    /// The generators of at most eight streams, at their beginning; lanes beyond them draw zeros.
    pub fn new(keys: &[StreamKey<'_>]) -> Self {
        let mut state = [[0; LANES]; 4];
        for (lane, key) in keys.iter().enumerate() {
            let bytes = key.state();
            for (of_lanes, word) in state.iter_mut().zip(bytes.as_chunks::<8>().0) {
                of_lanes[lane] = u64::from_le_bytes(*word);
            }
        }
        Self { state }
    }

    /// The generators in registers.
    #[inline(always)]
    pub fn load<B: Bits>(&self) -> Xoshiro<B> {
        let s = &self.state;
        Xoshiro([
            B::load(&s[0]),
            B::load(&s[1]),
            B::load(&s[2]),
            B::load(&s[3]),
        ])
    }

    /// The generators back from registers.
    #[inline(always)]
    pub fn store<B: Bits>(&mut self, generators: Xoshiro<B>) {
        for (words, register) in self.state.iter_mut().zip(generators.0) {
            register.store(words);
        }
    }
}

/// The state of eight xoshiro256++ generators ([Blackman and Vigna](crate::bibliography::Blackman21)) in registers.
#[derive(Clone, Copy)]
pub struct Xoshiro<B>([B; 4]);

impl<B: Bits> Xoshiro<B> {
    /// The next number of each.
    #[inline(always)]
    pub fn draw(&mut self) -> B {
        let rotate = |x: B, count: u64| x.shl(count).or(x.shr(64 - count));
        let s = &mut self.0;
        let next = rotate(s[0].add(s[3]), 23).add(s[0]);
        let t = s[1].shl(17);
        s[2] = s[2].xor(s[0]);
        s[3] = s[3].xor(s[1]);
        s[1] = s[1].xor(s[2]);
        s[0] = s[0].xor(s[3]);
        s[2] = s[2].xor(t);
        s[3] = rotate(s[3], 45);
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    const KEY: StreamKey<'_> = StreamKey {
        seed: 1,
        scenario: "",
        run: 0,
        source: "accel.x",
        process: "WN",
    };

    #[test]
    fn streams_differ_in_every_part_of_the_key() {
        let keys = [
            KEY,
            StreamKey { seed: 2, ..KEY },
            StreamKey {
                scenario: "a",
                ..KEY
            },
            StreamKey { run: 1, ..KEY },
            StreamKey {
                source: "accel.y",
                ..KEY
            },
            StreamKey {
                process: "QN",
                ..KEY
            },
            StreamKey {
                source: "accel.xW",
                process: "N",
                ..KEY
            },
        ];
        let first: std::collections::HashSet<u64> =
            keys.iter().map(|k| k.generator().next_u64()).collect();
        assert_eq!(first.len(), keys.len());
    }

    #[test]
    fn lanes_draw_as_generators_do() {
        let keys = [KEY, StreamKey { run: 1, ..KEY }];
        let mut lanes = LaneGenerator::new(&keys);
        let mut registers = lanes.load::<[u64; LANES]>();
        let first = [registers.draw(), registers.draw()];
        lanes.store(registers);
        let third = lanes.load::<[u64; LANES]>().draw();
        for (lane, key) in keys.iter().enumerate() {
            let mut alone = key.generator();
            let drawn = [(); 3].map(|()| alone.next_u64());
            assert_eq!([first[0][lane], first[1][lane], third[lane]], drawn);
        }
        assert_eq!(third[2..], [0; 6]);
    }

    /// Pins the numbers: a new version of a crate that changes them must not pass unnoticed.
    #[test]
    fn golden_values() {
        let mut g = KEY.generator();
        let drawn: [u64; 2] = [g.next_u64(), g.next_u64()];
        assert_eq!(
            drawn,
            [6_952_805_350_898_267_710, 12_540_074_639_726_233_183]
        );
    }
}
