//! Ids of campaigns and runs.

use actcheck_base::Digest;

/// The id of a run from its campaign and its index.
pub(crate) fn run_id(campaign: &str, index: u64) -> String {
    format!("{campaign}-{}", index + 1)
}

/// The campaign and the index of a run, from its id.
pub(crate) fn place_of(run: &str) -> Option<(&str, u64)> {
    let (campaign, number) = run.rsplit_once('-')?;
    let index = number.parse::<u64>().ok()?.checked_sub(1)?;
    // Only the number as this program writes it.
    (run == run_id(campaign, index)).then_some((campaign, index))
}

/// Computes a campaign's id: a letter and three letters or digits, without characters that look
/// alike.
pub(crate) fn campaign_id(revision: &str, seed: u64, counter: u64) -> String {
    const LETTERS: &[u8] = b"abcdefghjkmnpqrstvwxyz";
    const ALL: &[u8] = b"abcdefghjkmnpqrstvwxyz23456789";
    let mut digest = Digest::new();
    digest.update(revision.as_bytes());
    digest.update(&seed.to_le_bytes());
    digest.update(&counter.to_le_bytes());
    let bytes = digest.finish().into_bytes();
    let number = |at: usize| {
        bytes[at..at + 4]
            .iter()
            .fold(0usize, |sum, byte| sum * 256 + usize::from(*byte))
    };
    [(LETTERS, 0), (ALL, 4), (ALL, 8), (ALL, 12)]
        .map(|(set, at)| char::from(set[number(at) % set.len()]))
        .iter()
        .collect()
}
