//! Selects the contacts of an action that are shown.

use actcheck_data::ContactEpisode;

/// Maximum number of contacts shown for an action.
const MOST_CONTACTS: usize = 60;

/// Returns the strongest contacts in chronological order.
pub(super) fn strongest(contacts: &[ContactEpisode]) -> Vec<&ContactEpisode> {
    let mut all: Vec<&ContactEpisode> = contacts.iter().collect();
    if all.len() > MOST_CONTACTS {
        all.sort_by(|a, b| b.max_force_n.total_cmp(&a.max_force_n));
        all.truncate(MOST_CONTACTS);
        all.sort_by(|a, b| a.start_secs.total_cmp(&b.start_secs));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_contacts_are_shown_in_order_of_their_start() {
        let contact = |idx: u32| ContactEpisode {
            pair: ["floor".to_owned(), "mug_1".to_owned()],
            start_secs: f64::from(100 - idx),
            end_secs: 200.0,
            max_force_n: f64::from(idx % 50),
            point_m: [0.0; 3],
        };
        let all: Vec<ContactEpisode> = (0..100).map(contact).collect();
        let shown = strongest(&all);
        assert_eq!(shown.len(), MOST_CONTACTS);
        assert!(shown.iter().all(|contact| contact.max_force_n >= 20.0));
        assert!(shown.is_sorted_by(|a, b| a.start_secs <= b.start_secs));
        assert_eq!(strongest(&all[..3]), all[..3].iter().collect::<Vec<_>>());
    }
}
