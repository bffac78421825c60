//! From runs to findings: made-up runs through the tables on disk, and real runs through the
//! program.

use std::collections::BTreeMap;

use actcheck::analysis::{
    Condition, Hierarchy, Interval, Mirror, OutcomeTable, PatternOptions, PerceptionError,
    PropertyFindings, Surrounding, TableFilter, TableRun, cascades, collisions, finding_columns,
    flaky_scenes, judged, property_findings, table_failure_modes, trend, two_way,
};
use actcheck::base::Outcome::{self, Failed, Inapplicable, Passed, Untested};
use actcheck::history::{Repetition, RunDetail};
use actcheck::report::{
    FindingsSummary, Page, PropertyReport, collisions_picture, findings_text, patterns_picture,
};

use crate::support::made_up;
use crate::support::planted::Dice;

fn outcome(failed: bool) -> Outcome {
    if failed { Failed } else { Passed }
}

/// Slipping bottles are not in the hand, and objects that are not in the hand can't be placed.
pub fn runs(campaign: &str, count: u64, slippery: f64) -> Vec<RunDetail> {
    let mut dice = Dice::new(campaign.len() as u64 * 1000 + count);
    (0..count)
        .map(|index| {
            let lost = std::cell::Cell::new(false);
            made_up::run(
                campaign,
                index,
                &mut dice,
                &["Pick", "Place"],
                |target, step, dice| {
                    if step == 0 {
                        let slips = target.category.ends_with("Bottle") && target.friction < 0.5;
                        lost.set(dice.share() < if slips { 0.8 } else { slippery });
                        vec![("InHand", outcome(lost.get())), ("Near", Passed)]
                    } else {
                        vec![
                            ("Placed", outcome(lost.get() || dice.share() < 0.1)),
                            ("Upright", Inapplicable),
                        ]
                    }
                },
            )
        })
        .collect()
}

fn table(
    runs: impl IntoIterator<Item = impl Into<TableRun>>,
    filter: &TableFilter,
) -> OutcomeTable {
    let folder = tempfile::tempdir().unwrap();
    let mut by_campaign: BTreeMap<String, Vec<TableRun>> = BTreeMap::new();
    for run in runs.into_iter().map(Into::into) {
        by_campaign
            .entry(run.detail.row.campaign.clone())
            .or_default()
            .push(run);
    }
    // One folder of files, like the mirrors of campaigns beside a history.
    let all: Vec<TableRun> = by_campaign.into_values().flatten().collect();
    let mirror = Mirror::of_runs(folder.path(), "all", all).unwrap();
    OutcomeTable::read(&mirror, filter, &finding_columns()).unwrap()
}

fn hierarchy() -> Hierarchy {
    made_up::CLASSES
        .map(|class| {
            (
                format!("http://actions#{class}"),
                vec!["Container".to_owned()],
            )
        })
        .into()
}

#[test]
fn a_pattern_is_reported_with_its_runs() {
    let table = table(runs("k", 3_000, 0.05), &TableFilter::default());
    let judged = judged(&table);
    let names: Vec<&str> = judged.iter().map(|of| of.property.as_str()).collect();
    let expected =
        ["InHand", "Near", "Placed", "Upright"].map(|name| format!("http://actions#{name}"));
    assert_eq!(names, expected.each_ref().map(String::as_str));
    let found = property_findings(&table, &judged[0], &hierarchy(), &PatternOptions::default());
    let patterns: Vec<_> = found.patterns.confirmed().collect();
    assert_eq!(patterns.len(), 1, "{:#?}", found.patterns);
    let parameters: Vec<&str> = patterns[0]
        .conditions
        .iter()
        .map(|condition| found.input.parameters[condition.parameter()].name.as_str())
        .collect();
    assert_eq!(parameters, ["target_category", "target_friction"]);
    for run in &patterns[0].runs {
        let row = found.examples[*run].row as usize;
        assert_eq!(
            table.text("target_category").get(row),
            Some("http://actions#Bottle")
        );
        assert!(table.number("target_friction")[row] < 0.52);
        assert_eq!(
            table.text("run").get(row),
            Some(found.examples[*run].run.as_str())
        );
    }
    let margins = found.margins.unwrap();
    assert_eq!(
        (margins.count, margins.least, margins.most),
        (3_000, -0.01, 0.02)
    );
    let never = property_findings(&table, &judged[1], &hierarchy(), &PatternOptions::default());
    assert_eq!(
        (never.counts.passed, never.patterns.patterns.len()),
        (3_000, 0)
    );
    let undecided = property_findings(&table, &judged[3], &hierarchy(), &PatternOptions::default());
    assert_eq!(
        (
            undecided.failing,
            undecided.counts.inapplicable,
            undecided.input.len()
        ),
        (None, 3_000, 0)
    );
    let map = two_way(&found.input, &["target_category", "target_friction"]).unwrap();
    assert_eq!(
        map.cells
            .iter()
            .flatten()
            .map(|cell| cell.runs)
            .sum::<u64>(),
        3_000
    );
    assert_eq!(map.down[0], "Bottle");
    assert!(
        map.cells[0][0].failing.unwrap().rate > 0.6
            && map.cells[0].last().unwrap().failing.unwrap().rate < 0.3
    );
    assert!(two_way(&found.input, &["nothing"]).is_none());
}

/// Picks that fail because of two causes: targets that are turned away, and targets that were
/// perceived off by more than 4 cm.
fn with_two_causes(count: u64) -> Vec<TableRun> {
    let mut dice = Dice::new(11);
    (0..count)
        .map(|index| {
            let off_m = 0.08 * dice.share();
            let detail = made_up::run("k", index, &mut dice, &["Pick"], |target, _, dice| {
                let rate = match (target.yaw.abs() > 2.5, off_m > 0.04) {
                    (true, _) => 0.7,
                    (_, true) => 0.5,
                    _ => 0.04,
                };
                vec![("InHand", outcome(dice.share() < rate))]
            });
            let mut run = TableRun::from(detail);
            let direction = std::f64::consts::TAU * dice.share();
            let [ahead_m, left_m] = [off_m * direction.cos(), off_m * direction.sin()];
            run.effects[0].perceived = Some(PerceptionError {
                ahead_m,
                left_m,
                above_m: 0.01 * dice.share(),
            });
            run.effects[0].last_phase = Some(
                if dice.share() < 0.3 {
                    "lift"
                } else {
                    "retract"
                }
                .to_owned(),
            );
            run.noise[0].localisation = [Some(dice.share()), Some(dice.share()), None];
            run
        })
        .collect()
}

#[test]
fn a_condition_and_an_effect_are_listed_apart() {
    let table = table(with_two_causes(600), &TableFilter::default());
    let found = property_findings(
        &table,
        &judged(&table)[0],
        &hierarchy(),
        &PatternOptions::default(),
    );
    let report = report(&table, found);
    let [when, how] = [report.when(), report.how()].map(|causes| {
        let all: Vec<String> = causes
            .patterns
            .confirmed()
            .map(|pattern| causes.conditions(&pattern.conditions))
            .collect();
        all
    });
    // A direction wraps: both ends are one condition.
    let is_arc =
        |words: &str| words.starts_with("target yaw beyond ±2.") || words.contains(" or < -2.");
    assert!(
        matches!(when.as_slice(), [only] if is_arc(only)),
        "{when:?}"
    );
    assert!(
        matches!(how.as_slice(), [only] if only.starts_with("target perceived off ≥ 0.0")),
        "{how:?}"
    );
    let text = findings_text(&summary_of(&table, report), true, Page::default());
    let [condition, effect] = ["when (", "how ("].map(|title| text.find(title).unwrap());
    let place = |words: &str| {
        text.find(words)
            .unwrap_or_else(|| panic!("{words}: {text}"))
    };
    assert!(
        condition < place(&when[0]) && place(&when[0]) < effect,
        "{text}"
    );
    assert!(effect < place("target perceived off"), "{text}");
}

#[test]
fn without_a_significant_condition_the_strongest_are_shown_as_unsure() {
    let table = table(with_two_causes(40), &TableFilter::default());
    let found = property_findings(
        &table,
        &judged(&table)[0],
        &hierarchy(),
        &PatternOptions::default(),
    );
    let patterns = &found.patterns;
    assert!(
        patterns.confirmed().next().is_none() && (1..=3).contains(&patterns.strongest.len()),
        "{patterns:#?}"
    );
    for strongest in &patterns.strongest {
        let (inside, outside) = (strongest.rate, strongest.elsewhere);
        assert!(
            inside.rate > outside.rate && inside.low < inside.rate && inside.rate < inside.high,
            "{strongest:?}"
        );
        assert!(
            strongest.p <= strongest.p_corrected && strongest.runs_needed.unwrap() > 40.0,
            "{strongest:?}"
        );
    }
    assert!(
        patterns
            .strongest
            .windows(2)
            .all(|pair| pair[0].condition.parameter() != pair[1].condition.parameter())
    );
    let text = findings_text(
        &summary_of(&table, report(&table, found)),
        true,
        Page::default(),
    );
    assert!(
        text.contains("none is confirmed beyond chance; the strongest (perhaps by chance):"),
        "{text}"
    );
    assert!(text.contains("if it is real, about "), "{text}");
}

/// Every second run hits a mug to the left of the target, with 5 N; each has a can beyond it, which
/// is never hit.
#[test]
fn collisions_are_counted_by_type_and_place() {
    let thing =
        |object: &str, class: &str, [beyond, left]: [f64; 2], force_n: Option<f64>| Surrounding {
            object: object.to_owned(),
            category: format!("http://actions#{class}"),
            role: if class == "Table" {
                "platform"
            } else {
                "other"
            }
            .to_owned(),
            beyond_m: Some(beyond),
            left_m: Some(left),
            force_n,
            by: force_n.map(|_| "robot/palm_link".to_owned()),
            at_s: force_n.map(|_| 2.5),
            phase: force_n.map(|_| "approach".to_owned()),
        };
    let mut dice = Dice::new(5);
    let runs = (0..40).map(|index| {
        let mut run = TableRun::from(made_up::run("k", index, &mut dice, &["Pick"], |_, _, _| {
            vec![("InHand", Passed), ("Near", Passed)]
        }));
        let hit = (index % 2 == 0).then_some(5.0 + index as f64);
        let table = (index == 0).then(|| thing("table_1", "Table", [-0.5, 0.0], Some(700.0)));
        let others = [
            thing("mug_2", "Mug", [0.01, 0.15], hit),
            thing("can_3", "Can", [0.3, 0.0], None),
        ];
        run.effects[0].surroundings = Some(others.into_iter().chain(table).collect());
        run
    });
    let table = table(runs.collect::<Vec<TableRun>>(), &TableFilter::default());
    let found = collisions(&table);
    assert_eq!(found.len(), 1);
    let of = &found[0];
    assert_eq!(
        (of.executions, of.hit, of.kinds.len(), of.things.len()),
        (40, 20, 2, 81)
    );
    let [mug, furniture] = &of.kinds[..] else {
        panic!("{:?}", of.kinds)
    };
    assert_eq!(
        (mug.category.as_str(), mug.hit, mug.present, mug.furniture),
        ("http://actions#Mug", 20, 40, false)
    );
    assert_eq!(
        (mug.force_n.least, mug.force_n.most, mug.rate.rate),
        (5.0, 43.0, 0.5)
    );
    assert_eq!(mug.by, [("robot/palm_link".to_owned(), 20)]);
    assert_eq!(
        (&mug.directions[..], mug.runs[0].as_str()),
        (&[("left of it".to_owned(), 20)][..], "k-39")
    );
    assert_eq!(
        (furniture.hit, furniture.present, furniture.furniture),
        (1, 40, true)
    );
    let sectors: Vec<_> = of
        .sectors
        .iter()
        .flatten()
        .filter(|sector| sector.present > 0)
        .collect();
    let counts: Vec<_> = sectors
        .iter()
        .map(|it| (it.direction, it.distance_m, it.present, it.hit))
        .collect();
    assert_eq!(
        counts,
        [
            ("beyond it", (0.2, Some(0.4)), 40, 0),
            ("left of it", (0.1, Some(0.2)), 40, 20)
        ],
        "furniture is not movable"
    );
    let summary = summary(&table, 0);
    let text = findings_text(&summary, true, Page::default());
    assert!(
        text.contains("Pick: in 50 % [35–65] of 40 runs") && text.contains("Table (furniture)"),
        "{text}"
    );
    let svg = collisions_picture(&summary).unwrap().to_svg();
    assert!(
        svg.contains("Mug: hit in 20 of 40") && svg.contains("approach"),
        "{svg}"
    );
}

/// The summary of one property, as `actcheck analyse` makes it.
fn summary(table: &OutcomeTable, property: usize) -> FindingsSummary {
    let of = &judged(table)[property];
    let findings = property_findings(table, of, &hierarchy(), &PatternOptions::default());
    FindingsSummary {
        counts: of.counts,
        ..summary_of(table, report(table, findings))
    }
}

fn report(table: &OutcomeTable, findings: PropertyFindings) -> PropertyReport {
    let all = judged(table);
    let of = all
        .iter()
        .find(|of| of.property == findings.property && of.action == findings.action)
        .unwrap();
    PropertyReport {
        unit: None,
        trend: trend(table, of, 0.05),
        flaky: Vec::new(),
        repeated_scenes: 0,
        maps: Vec::new(),
        findings,
    }
}

fn summary_of(table: &OutcomeTable, report: PropertyReport) -> FindingsSummary {
    FindingsSummary {
        sampling: table.sampling,
        history: "h".to_owned(),
        program: "actcheck".to_owned(),
        options: String::new(),
        campaigns: vec!["k".to_owned()],
        runs: table.text("run").texts.len() as u64,
        sampled_runs: None,
        twins: 0,
        counts: report.findings.counts,
        modes: Vec::new(),
        cascades: Vec::new(),
        collisions: collisions(table),
        properties: vec![report],
        level: 0.05,
    }
}

#[test]
fn a_pattern_is_drawn_with_its_sentence_and_every_run_in_its_colour() {
    let table = table(runs("k", 1_500, 0.05), &TableFilter::default());
    let found = summary(&table, 0);
    let svg = patterns_picture(&found)
        .expect("there is a pattern")
        .to_svg();
    assert!(
        svg.contains("InHand fails") && svg.contains("Bottle"),
        "{svg}"
    );
    // All runs of the pattern's kind are drawn, with two strokes for each failed run.
    let findings = &found.properties[0].findings;
    let pattern = findings.patterns.confirmed().next().unwrap();
    let kind = pattern
        .conditions
        .iter()
        .find(|condition| matches!(condition, Condition::Kind { .. }))
        .unwrap();
    let holds = kind.holds(&findings.input);
    let failed = holds
        .iter()
        .zip(&findings.input.failed)
        .filter(|(holds, failed)| **holds && **failed)
        .count();
    let strokes = svg
        .lines()
        .map(|line| line.matches('M').count())
        .filter(|count| *count == 2 * failed)
        .count();
    assert!(failed > 50 && strokes >= 1, "{failed} failed, {svg}");
    // A property that never fails has no pattern, and without a pattern there is no picture.
    assert!(patterns_picture(&summary(&table, 1)).is_none());
}

#[test]
fn only_a_failure_that_leads_to_a_later_one_is_reported() {
    let table = table(runs("k", 800, 0.1), &TableFilter::default());
    let found = cascades(&table, 0.05);
    assert_eq!(found.len(), 1, "{found:#?}");
    let (first, later) = (&found[0].first, &found[0].later);
    assert_eq!(
        (first.step, first.property.as_str()),
        (1, "http://actions#InHand")
    );
    assert_eq!(
        (later.step, later.property.as_str()),
        (2, "http://actions#Placed")
    );
    assert_eq!(found[0].table.passed_in, 0, "a lost object is never placed");
    let modes = table_failure_modes(&table);
    assert!(modes[0].failed.is_empty() && modes.len() == 3, "{modes:#?}");
    assert_eq!(modes.iter().map(|mode| mode.runs.len()).sum::<usize>(), 800);
}

#[test]
fn a_change_between_campaigns_is_located() {
    let campaigns = [
        ("a", 0.05),
        ("b", 0.05),
        ("c", 0.05),
        ("d", 0.4),
        ("e", 0.4),
    ];
    let all = campaigns
        .into_iter()
        .flat_map(|(name, slippery)| runs(name, 150, slippery));
    let table = table(all, &TableFilter::default());
    let found = trend(&table, &judged(&table)[0], 0.05);
    assert_eq!(
        found
            .points
            .iter()
            .map(|point| point.runs)
            .collect::<Vec<_>>(),
        [150; 5]
    );
    assert_eq!(
        found
            .changes
            .iter()
            .map(|change| change.at)
            .collect::<Vec<_>>(),
        [3],
        "{found:#?}"
    );
    assert!(found.changes[0].before.high < found.changes[0].behind.low);
}

#[test]
fn equal_runs_count_once() {
    let mut all = runs("k", 60, 0.3);
    let twin = all[10].row.trace_hash.clone();
    all[40].row.trace_hash = twin;
    for (index, run) in all.iter_mut().enumerate().take(9) {
        run.row.repetition = Some(Repetition {
            scene: index as u64 / 3,
            number: index as u64 % 3,
        });
    }
    let table = table(all, &TableFilter::default());
    let judged = judged(&table);
    let found = property_findings(&table, &judged[0], &hierarchy(), &PatternOptions::default());
    assert_eq!((found.twins, found.repeated, found.input.len()), (1, 6, 53));
    assert!(
        !found.examples.iter().any(|example| example.run == "k-11"),
        "of two equal runs the newer one counts"
    );
    let (flaky, scenes) = flaky_scenes(&table, &judged[0]);
    assert_eq!(scenes, 3);
    assert!(
        flaky
            .iter()
            .all(|scene| scene.passed > 0 && scene.passed < scene.of && scene.of == 3),
        "{flaky:?}"
    );
}

/// Five runs of each scene with equal results have the weight of one: no interval is narrower, and
/// no p-value smaller.
#[test]
fn repeated_runs_of_a_scene_do_not_increase_significance() {
    let once = runs("k", 60, 0.3);
    let repeat = |number: u64| {
        once.iter().cloned().map(move |mut run| {
            run.row.repetition = Some(Repetition {
                scene: run.row.index,
                number,
            });
            run.row.index += 60 * number;
            run.row.run = format!("k-{}", run.row.index + 1);
            run.row.trace_hash = format!("{:032x}", run.row.index);
            run
        })
    };
    let five = table((0..5).flat_map(repeat), &TableFilter::default());
    let once = table(once.clone(), &TableFilter::default());
    assert_eq!(five.len(), 5 * once.len());
    let alike = |a: Interval, b: Interval| {
        [a.rate - b.rate, a.low - b.low, a.high - b.high]
            .into_iter()
            .all(|apart| apart.abs() < 1e-12)
    };
    for (a, b) in table_failure_modes(&once)
        .into_iter()
        .zip(table_failure_modes(&five))
    {
        assert!(
            a.failed == b.failed && 5 * a.runs.len() == b.runs.len() && alike(a.share, b.share),
            "{a:?} {b:?}"
        );
    }
    assert!(!cascades(&once, 0.05).is_empty());
    assert_eq!(cascades(&once, 0.05), cascades(&five, 0.05));
    for (a, b) in judged(&once).iter().zip(judged(&five).iter()) {
        assert_eq!(trend(&once, a, 0.05).points, trend(&five, b, 0.05).points);
        let [a, b] = [(&once, a), (&five, b)].map(|(table, of)| {
            property_findings(table, of, &hierarchy(), &PatternOptions::default()).failing
        });
        assert!(a.zip(b).is_none_or(|(a, b)| alike(a, b)), "{a:?} {b:?}");
    }
}

#[test]
fn undecided_outcomes_are_not_failures() {
    let mut dice = Dice::new(3);
    let all = Outcome::ALL.map(|outcome| {
        made_up::run(
            "k",
            u64::from(outcome as u8),
            &mut dice,
            &["Pick"],
            |_, _, _| vec![("InHand", outcome)],
        )
    });
    let table = table(all, &TableFilter::default());
    let of = &judged(&table)[0];
    assert_eq!((of.counts.total(), of.counts.decided()), (6, 2));
    assert_eq!(
        table_failure_modes(&table)
            .iter()
            .map(|mode| mode.runs.len())
            .sum::<usize>(),
        2
    );
    assert_eq!(trend(&table, of, 0.05).points[0].runs, 2);
    assert_eq!(of.counts.get(Untested), 1);
}

#[test]
fn rows_are_filtered_by_campaign_and_time() {
    let all = || runs("k", 56, 0.1);
    let since = TableFilter {
        since: Some("2026-01-15T00:00:00Z".to_owned()),
        ..TableFilter::default()
    };
    assert_eq!(table(all(), &since).len(), 4 * 28);
    let other = TableFilter {
        campaigns: Some(vec!["other".to_owned()]),
        ..TableFilter::default()
    };
    assert!(table(all(), &other).is_empty());
}
