//! `actcheck check`

use crate::base::Diagnostics;
use crate::campaign::Env;
use crate::cli::args::CheckArgs;
use crate::cli::output;
use crate::config::Overrides;

/// Says what a campaign would use, or everything that is wrong with it.
pub fn check(args: &CheckArgs) -> Result<(), Diagnostics> {
    let env = Env::prepare(&args.config, &Overrides::default())?;
    output::print_diagnostics(env.rules.warnings());
    output::print(&format!(
        "{}: {} tests, {} runs; {} actions and {} properties in {}; {} models; robot {}\n",
        args.config.display(),
        env.campaign.tests.len(),
        env.planned_runs(),
        env.ontology.actions.len(),
        env.ontology.properties.len(),
        env.ontology.sources.first().map_or("", |source| &source.name),
        env.campaign.models.len(),
        env.campaign.robot.name,
    ));
    Ok(())
}
