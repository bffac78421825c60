//! Answers to a program's requests: pictures, points, and the objects of the reference perception.
//! No simulated time passes.

use nalgebra::Isometry3;
use serde::Serialize;

use crate::message::{Ask, Binary, What, WireObject, WirePose};
use actcheck_actions::Operator;
use actcheck_base::printable;
use actcheck_data::{AnsweredObject, AnsweredQuestion, Pose};
use actcheck_world::DepthImage;

/// An answer.
#[derive(Debug, Serialize)]
pub struct Answer {
    r#type: &'static str,
    #[serde(flatten)]
    content: Content,
}

#[derive(Debug, Serialize)]
#[serde(tag = "what", rename_all = "snake_case")]
enum Content {
    Depth(Image),
    Rgb(Image),
    Cloud { binary: [Binary; 1] },
    Objects { objects: Vec<WireObject> },
}

/// An image of the camera. Its pose is by the robot's belief.
#[derive(Debug, Serialize)]
struct Image {
    camera_pose: WirePose,
    width: usize,
    height: usize,
    horizontal_fov_rad: f64,
    focal_px: f64,
    binary: [Binary; 1],
}

/// Number of objects of an answer that are recorded.
const MOST_OBJECTS: usize = 8;
/// Longest id of a requested object that is recorded. Unit: characters.
const LONGEST_ID: usize = 100;

impl Answer {
    /// The record of the request and of this answer, whose binary data have `bytes`.
    pub fn record(&self, ask: &Ask, bytes: usize) -> AnsweredQuestion {
        let (count, objects) = match &self.content {
            Content::Depth(image) | Content::Rgb(image) => (image.width * image.height, &[][..]),
            Content::Cloud {
                binary: [Binary { shape, .. }],
            } => (shape.first().copied().unwrap_or(0), &[][..]),
            Content::Objects { objects } => (objects.len(), objects.as_slice()),
        };
        let id = |text: &str| printable(text).chars().take(LONGEST_ID).collect();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "seven digits are enough to read a position"
        )]
        let object = |object: &WireObject| AnsweredObject {
            id: object.id.clone(),
            position_m: object.pose.position_m.map(|along| along as f32),
        };
        AnsweredQuestion {
            what: ask.what.word().to_owned(),
            of: ask.of.as_deref().map(id),
            count: count as u64,
            bytes: bytes as u64,
            objects: objects.iter().take(MOST_OBJECTS).map(object).collect(),
        }
    }
}

/// The answer to a request, and the payload of the binary frame that follows it, if any.
pub fn answer(ask: &Ask, robot: &mut Operator<'_>) -> (Answer, Option<Vec<u8>>) {
    let (content, bytes) = match ask.what {
        What::Depth => depth(robot),
        What::Rgb => rgb(robot),
        What::Cloud => cloud(robot),
        What::Objects => (
            Content::Objects {
                objects: objects(ask.of.as_deref(), robot),
            },
            None,
        ),
    };
    (
        Answer {
            r#type: "answer",
            content,
        },
        bytes,
    )
}

/// A depth image, and the camera's pose by the robot's belief.
fn look(robot: &mut Operator<'_>) -> (DepthImage, Isometry3<f64>) {
    let image = robot.look();
    (image, robot.kinematics().camera(&robot.observe().positions))
}

fn depth(robot: &mut Operator<'_>) -> (Content, Option<Vec<u8>>) {
    let image = robot.look();
    let bytes = image
        .depths
        .iter()
        .flat_map(|depth| depth.to_le_bytes())
        .collect();
    let binary = Binary {
        name: "depth",
        dtype: "f32",
        shape: vec![image.height, image.width],
    };
    (Content::Depth(described(binary, robot)), Some(bytes))
}

fn rgb(robot: &mut Operator<'_>) -> (Content, Option<Vec<u8>>) {
    let image = robot.picture();
    let binary = Binary {
        name: "rgb",
        dtype: "u8",
        shape: vec![image.height, image.width, 3],
    };
    (Content::Rgb(described(binary, robot)), Some(image.bytes))
}

/// An image with the camera's intrinsics and pose.
fn described(binary: Binary, robot: &Operator<'_>) -> Image {
    let camera = robot.camera();
    let pose = robot.kinematics().camera(&robot.observe().positions);
    Image {
        camera_pose: WirePose::of(&Pose::from_isometry(&pose)),
        width: camera.width as usize,
        height: camera.height as usize,
        horizontal_fov_rad: camera.field_of_view_rad,
        focal_px: camera.focal_px(),
        binary: [binary],
    }
}

fn cloud(robot: &mut Operator<'_>) -> (Content, Option<Vec<u8>>) {
    let (image, camera) = look(robot);
    let mut bytes = Vec::with_capacity(12 * image.depths.len());
    for row in 0..image.height {
        for point in (0..image.width).filter_map(|column| image.point(column, row)) {
            let point = camera * point;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "depths have 32 bits, more digits would be invented"
            )]
            bytes.extend(
                [point.x, point.y, point.z]
                    .into_iter()
                    .flat_map(|along| (along as f32).to_le_bytes()),
            );
        }
    }
    let shape = vec![bytes.len() / 12, 3];
    (
        Content::Cloud {
            binary: [Binary {
                name: "cloud",
                dtype: "f32",
                shape,
            }],
        },
        Some(bytes),
    )
}

fn objects(of: Option<&str>, robot: &mut Operator<'_>) -> Vec<WireObject> {
    let seen = match of {
        Some(id) => robot.see(id).into_iter().collect(),
        None => robot.see_where(|_| true),
    };
    let objects = seen.into_iter().map(|thing| WireObject {
        category: robot.kind_of(&thing.id).map(|kind| kind.category),
        id: thing.id,
        pose: WirePose::of(&thing.pose),
        size_m: thing.size_m,
        furniture: thing.furniture,
    });
    objects.collect()
}
