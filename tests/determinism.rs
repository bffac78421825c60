//! Every shipped campaign gives the same outcomes, scores and body states with one worker and with two. Its physics is
//! replaced by the coarsest, since the robot does not need to succeed.

use crate::support::{COARSEST, actcheck, project_with, root, stderr, stdout};

#[test]
fn every_shipped_campaign_is_the_same_with_one_and_two_workers() {
    let project = project_with(COARSEST);
    let mut configs: Vec<String> = std::fs::read_dir(root().join("configs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    configs.sort();
    assert!(configs.len() >= 5, "{configs:?}");
    for name in configs {
        let config = format!("configs/{name}");
        let file = project.path().join(&config);
        let text = std::fs::read_to_string(&file).unwrap();
        if !text.contains("[physics]") {
            std::fs::write(&file, text + COARSEST).unwrap();
        }
        let [one, two] = ["1", "2"].map(|jobs| {
            let history = format!("{name}-{jobs}");
            let run = ["run", &config, "--runs", "2", "--jobs", jobs, "--history", &history, "--format", "csv"];
            let outcomes = actcheck(project.path(), &run);
            assert!(outcomes.status.code() < Some(2), "{name}: {}", stderr(&outcomes));
            // Scores and the digests over all states.
            let list = actcheck(project.path(), &["list", "--history", &history, "--format", "csv"]);
            (stdout(&outcomes), stdout(&list))
        });
        assert!(one.1.lines().count() == 3, "{name}: {}", one.1);
        assert_eq!(one, two, "{name}");
    }
}
