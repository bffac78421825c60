//! The parts of choice names: objects and axes, each with its word.

use std::fmt;

/// Defines an enum whose variants are each written as one word.
macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $word:literal,)+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name {
            $($(#[$variant_doc])* $variant,)+
        }

        impl $name {
            /// All values, in order.
            pub const ALL: [Self; [$(Self::$variant),+].len()] = [$(Self::$variant),+];

            /// Returns the word.
            pub fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }

            /// Reads the word; `None` if it is not one of these.
            pub(super) fn read(word: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.word() == word)
            }
        }
    };
}

words! {
    /// A property of an object that a scene places.
    ObjectAxis {
        /// The model, a candidate.
        Model = "model",
        /// Whether a shrunk run leaves the object out.
        LeftOut = "left_out",
        /// Size as a factor of the model's.
        SizeScale = "size_scale",
        /// Mass as a factor of the model's.
        MassScale = "mass_scale",
        /// Friction as a factor of the model's.
        FrictionScale = "friction_scale",
        /// Coefficient of restitution.
        Restitution = "restitution",
        /// From 0 to 1; the object lies on its side below the configured share.
        Stands = "stands",
        /// Rotation about the vertical axis.
        Yaw = "yaw",
        /// Position along the x axis of the surface or the floor.
        X = "x",
        /// Position along the y axis of the surface or the floor.
        Y = "y",
    }
}

words! {
    /// A coordinate of the robot's initial base pose.
    StartAxis {
        /// Gap between the surface's edge and the base.
        Gap = "gap",
        /// Lateral offset from the surface's centre.
        Side = "side",
        /// Heading, relative to the surface if the base starts in front of it.
        Heading = "heading",
        /// Position along the world's x axis.
        X = "x",
        /// Position along the world's y axis.
        Y = "y",
    }
}

words! {
    /// A coordinate of a pose estimate of the base.
    PlanarAxis {
        /// Along the world's x axis.
        X = "x",
        /// Along the world's y axis.
        Y = "y",
        /// Heading.
        Heading = "heading",
    }
}

words! {
    /// An error of the wheel odometry.
    WheelAxis {
        /// Along the path, as a share of the distance.
        Along = "along",
        /// Across the path, as a share of the distance.
        Across = "across",
        /// Of the heading, as a share of the rotation.
        Turning = "turning",
        /// Of the heading, per distance. Unit: radians per metre.
        Veering = "veering",
    }
}

words! {
    /// A coordinate of a perceived object.
    SightingAxis {
        /// Position along the world's x axis.
        X = "x",
        /// Position along the world's y axis.
        Y = "y",
        /// Height.
        Z = "z",
        /// Rotation about the vertical axis.
        Yaw = "yaw",
        /// Size along the object's x axis.
        Width = "width",
        /// Size along the object's y axis.
        Depth = "depth",
        /// Size along the vertical axis.
        Height = "height",
    }
}

/// An object that a scene places. Numbers begin at 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PlacedObject {
    /// The object that the robot handles.
    Target,
    /// Another object on the target's surface.
    Other(u32),
    /// Another object on the surface where the target is to be placed.
    PlaceOther(u32),
    /// An obstacle on the floor.
    Obstacle(u32),
}

impl PlacedObject {
    /// The word, and the number if there are several such objects.
    fn parts(self) -> (&'static str, Option<u32>) {
        match self {
            Self::Target => ("target", None),
            Self::Other(number) => ("other", Some(number)),
            Self::PlaceOther(number) => ("place_other", Some(number)),
            Self::Obstacle(number) => ("obstacle", Some(number)),
        }
    }

    /// The word without the number: `other`.
    pub(super) fn word(self) -> &'static str {
        self.parts().0
    }

    /// Whether there are several such objects, with numbers.
    pub fn is_numbered(self) -> bool {
        self.parts().1.is_some()
    }

    /// Reads the written form; `None` if it is not one of these.
    pub(super) fn read(text: &str) -> Option<Self> {
        let Some((word, number)) = text.split_once('.') else {
            return (text == Self::Target.word()).then_some(Self::Target);
        };
        let number = number.parse().ok()?;
        let kinds = [
            Self::Other(number),
            Self::PlaceOther(number),
            Self::Obstacle(number),
        ];
        // `other.01` would be written as `other.1`.
        kinds
            .into_iter()
            .find(|object| object.word() == word && object.to_string() == text)
    }
}

impl fmt::Display for PlacedObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.parts() {
            (word, Some(number)) => write!(f, "{word}.{number}"),
            (word, None) => f.write_str(word),
        }
    }
}
