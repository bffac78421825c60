//! Serialises the fields of messages: CDR, little-endian, as middleware of ROS 2 does.
//!
//! Source: OMG DDS-XTypes 1.3, section 7.4, encoding version 1 (`PLAIN_CDR`).

use actcheck_data::Pose;

/// The encapsulation header: plain CDR, little-endian, no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A point in time. Unit: nanoseconds since the scene was built, in simulated time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Stamp(pub u64);

impl Stamp {
    const PER_SEC: u64 = 1_000_000_000;

    /// Rounds to whole nanoseconds. NaN and negative times become 0.
    pub fn of_secs(secs: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the cast saturates, as the documentation says"
        )]
        let nanos = (secs * 1e9).round() as u64;
        // Seconds of messages have 31 bits.
        Self(nanos.min(Self::PER_SEC * (1 << 31) - 1))
    }
}

/// A message that is being serialised: its fields are appended in the order of its type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    /// Begins a message.
    pub fn new() -> Self {
        Self {
            bytes: ENCAPSULATION.to_vec(),
        }
    }

    /// The bytes of the message.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }

    /// A number is aligned to its own size, counted from the end of the encapsulation header.
    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        let used = self.bytes.len() - ENCAPSULATION.len();
        self.bytes
            .resize(ENCAPSULATION.len() + used.next_multiple_of(N), 0);
        self.bytes.extend(bytes);
    }

    /// `uint8`, `byte` or `bool`.
    pub fn u8(&mut self, value: u8) {
        self.number([value]);
    }

    /// `uint32`.
    pub fn u32(&mut self, value: u32) {
        self.number(value.to_le_bytes());
    }

    /// `int32`.
    pub fn i32(&mut self, value: i32) {
        self.number(value.to_le_bytes());
    }

    /// `float32`.
    pub fn f32(&mut self, value: f32) {
        self.number(value.to_le_bytes());
    }

    /// `float64`.
    pub fn f64(&mut self, value: f64) {
        self.number(value.to_le_bytes());
    }

    /// `string`. Ends at the first NUL, which would end it in readers too.
    pub fn text(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        self.count(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    /// Number of elements of the sequence that follows.
    pub fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).unwrap_or(u32::MAX));
    }

    /// A sequence.
    pub fn each<T>(&mut self, items: &[T], mut write: impl FnMut(&mut Self, &T)) {
        self.count(items.len());
        items.iter().for_each(|item| write(self, item));
    }

    /// `builtin_interfaces/Time`, and `Duration` since 0.
    pub fn time(&mut self, at: Stamp) {
        let part = |nanos: u64| u32::try_from(nanos).unwrap_or(u32::MAX);
        self.u32(part(at.0 / Stamp::PER_SEC));
        self.u32(part(at.0 % Stamp::PER_SEC));
    }

    /// `std_msgs/Header`.
    pub fn header(&mut self, at: Stamp, frame: &str) {
        self.time(at);
        self.text(frame);
    }

    /// `geometry_msgs/Point` or `Vector3`.
    pub fn vector(&mut self, vector: [f64; 3]) {
        vector.into_iter().for_each(|value| self.f64(value));
    }

    /// `geometry_msgs/Pose` or `Transform`.
    pub fn pose(&mut self, pose: &Pose) {
        self.vector(pose.position);
        pose.rotation.into_iter().for_each(|value| self.f64(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the bytes after the encapsulation header, in hexadecimal digits.
    fn check(write: impl Fn(&mut Cdr), expected: &str) {
        let mut cdr = Cdr::new();
        write(&mut cdr);
        let bytes = cdr.finish();
        assert_eq!(bytes[..4], [0, 1, 0, 0]);
        let digits: String = bytes[4..]
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        assert_eq!(digits, expected.replace(' ', ""));
    }

    #[test]
    fn numbers_are_aligned_to_their_size() {
        check(
            |cdr| {
                cdr.u8(7);
                cdr.u32(1);
                cdr.u8(1);
                cdr.f64(1.0);
                cdr.f32(-2.0);
                cdr.i32(-1);
            },
            "07 000000 01000000 01 00000000000000 000000000000f03f 000000c0 ffffffff",
        );
    }

    #[test]
    fn strings_have_their_length_and_end_with_nul() {
        check(
            |cdr| {
                cdr.text("map");
                cdr.text("");
                cdr.text("a\0b");
            },
            "04000000 6d617000 01000000 00 000000 02000000 6100",
        );
    }

    /// `std_msgs/Header` and a sequence of `float64`, as rmw of ROS 2 writes them.
    #[test]
    fn a_header_and_a_sequence() {
        check(
            |cdr| {
                cdr.header(Stamp::of_secs(1.5), "map");
                cdr.each(&[0.5, 2.0], |cdr, value| cdr.f64(*value));
            },
            "01000000 0065cd1d 04000000 6d617000 02000000 00000000 000000000000e03f 0000000000000040",
        );
    }

    #[test]
    fn an_empty_sequence_is_its_length_alone() {
        check(|cdr| cdr.each::<f64>(&[], |cdr, v| cdr.f64(*v)), "00000000");
    }

    #[test]
    fn times_are_whole_nanoseconds_and_never_negative() {
        assert_eq!(Stamp::of_secs(0.1 + 0.2), Stamp(300_000_000));
        assert_eq!(Stamp::of_secs(-1.0), Stamp(0));
        assert_eq!(Stamp::of_secs(f64::NAN), Stamp(0));
        check(
            |cdr| cdr.time(Stamp::of_secs(f64::INFINITY)),
            "ffffff7f ffc99a3b",
        );
    }
}
