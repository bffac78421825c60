//! The robot's actions, performed through commands and observations: the reference skills and the
//! recorded trace.
//!
//! Never: reads ground truth inside a skill, judges an action, or knows a property.

mod call;
mod controls;
mod cup;
mod cut;
mod external;
mod forced;
mod forced_hand;
mod foresee;
mod grasp;
mod grip;
mod hindrance;
mod link_points;
mod memory;
mod misperception;
mod motion;
mod navigate;
mod operator;
mod pace;
mod perceive;
mod perform;
mod pick;
mod pick_fault;
mod place;
mod plan;
mod plan_cost;
mod rim;
mod route;
mod sabotage;
mod skills;
mod slant;
mod standing;
mod whereabouts;

pub use call::ActionCall;
pub use controls::Controls;
pub use cup::lips_on;
pub use cut::Cut;
pub use external::{ExternalFault, ExternalSkill};
pub use foresee::{
    ForeseenPick, ForeseenView, foresee_pick, foresee_view, needed_opening_m, takes_rim,
};
pub use grip::feels_in;
pub use hindrance::NoPlan;
pub use memory::Held;
pub use operator::{Interrupt, Operator};
pub use perform::{Gate, Interference, perform, perform_with};
pub use pick_fault::PickFault;
pub use sabotage::{Accident, Defect, Moment, Sabotage, Saboteur};
pub use skills::{UnknownSkill, known_skill};
