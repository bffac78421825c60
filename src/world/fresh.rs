//! Recomputes contacts in every step, those of hulls and cylinders in 64 bits.
//!
//! By default the engine keeps contact points until they have moved by about a millimetre or the
//! normal has turned by a degree. On a rolling rim, the kept point lags behind the true one; the
//! contact force then acts behind the point of support and adds energy: a slightly tipped bottle
//! rocked wider and wider until it fell. Recomputing the points avoids this energy gain.

use parry3d::math::{Pose, Real, Vector};
use parry3d::query::details::NormalConstraints;
use parry3d::query::{
    ClosestPoints, Contact, ContactManifold, ContactManifoldsWorkspace, DefaultQueryDispatcher,
    NonlinearRigidMotion, PersistentQueryDispatcher, QueryDispatcher, ShapeCastHit,
    ShapeCastOptions, ShapeDistance, ShapeIntersection, TrackedContact, Unsupported,
};
use parry3d::shape::{PackedFeatureId, PolygonalFeature, Shape};
use rapier3d::prelude::{ContactData, ContactManifoldData, NarrowPhase};

use actcheck_geometry::Hull;
use actcheck_geometry::Neighbours;
use actcheck_geometry::{Separation, SeparationOutcome, SolidPair};
use actcheck_geometry::{from_vector, to_real, to_vector};

/// Creates a narrow phase that does not reuse contact points from the previous step, and computes
/// those of hulls and cylinders in 64 bits.
pub fn narrow_phase() -> NarrowPhase {
    NarrowPhase::with_query_dispatcher(RecomputeContacts.chain(DefaultQueryDispatcher))
}

/// Invalidates cached contacts and leaves all other queries to the next dispatcher in the chain.
/// Warm starting still works: impulses are matched by feature.
struct RecomputeContacts;

impl QueryDispatcher for RecomputeContacts {
    fn intersection_test(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
    ) -> Result<ShapeIntersection, Unsupported> {
        Err(Unsupported)
    }

    fn distance(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
    ) -> Result<ShapeDistance, Unsupported> {
        Err(Unsupported)
    }

    fn contact(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Real,
    ) -> Result<Option<Contact>, Unsupported> {
        Err(Unsupported)
    }

    fn closest_points(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Real,
    ) -> Result<ClosestPoints, Unsupported> {
        Err(Unsupported)
    }

    fn cast_shapes(
        &self,
        _: &Pose,
        _: Vector,
        _: &dyn Shape,
        _: &dyn Shape,
        _: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Err(Unsupported)
    }

    fn cast_shapes_nonlinear(
        &self,
        _: &NonlinearRigidMotion,
        _: &dyn Shape,
        _: &NonlinearRigidMotion,
        _: &dyn Shape,
        _: Real,
        _: Real,
        _: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Err(Unsupported)
    }
}

impl PersistentQueryDispatcher<ContactManifoldData, ContactData> for RecomputeContacts {
    fn contact_manifolds(
        &self,
        pos12: &Pose,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
        prediction: Real,
        manifolds: &mut Vec<ContactManifold<ContactManifoldData, ContactData>>,
        workspace: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        for manifold in manifolds.iter_mut() {
            manifold.mark_shapes_deformed();
        }
        if between_solids(pos12, [shape1, shape2], prediction, manifolds) {
            return Ok(());
        }
        DefaultQueryDispatcher
            .contact_manifolds(pos12, shape1, shape2, prediction, manifolds, workspace)
    }

    fn contact_manifold_convex_convex(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Option<&dyn NormalConstraints>,
        _: Option<&dyn NormalConstraints>,
        _: Real,
        manifold: &mut ContactManifold<ContactManifoldData, ContactData>,
    ) -> Result<(), Unsupported> {
        manifold.mark_shapes_deformed();
        Err(Unsupported)
    }
}

/// Finds the contact of two convex solids with corners, in 64 bits (see `separation/mod.rs`).
/// Returns whether it did so: other shapes, boxes, and solids for which the search fails are left
/// to the library.
fn between_solids(
    pos12: &Pose,
    shapes: [&dyn Shape; 2],
    prediction: Real,
    manifolds: &mut Vec<ContactManifold<ContactManifoldData, ContactData>>,
) -> bool {
    let [Some((first, 0.0)), Some((second, 0.0))] = shapes.map(Shape::as_polygonal_feature_map)
    else {
        return false;
    };
    let [Some(one), Some(other)] = shapes.map(Shape::as_support_map) else {
        return false;
    };
    if shapes.iter().all(|shape| shape.as_cuboid().is_some()) {
        return false;
    }
    let memory = memory_of(shapes);
    if manifolds.is_empty() {
        manifolds.push(ContactManifold::new());
        memory.inspect(|(known, other)| known.forget(*other));
    }
    let [manifold] = manifolds.as_mut_slice() else {
        return false;
    };
    let mut corners = match memory.map(|(known, around)| known.look(around, shapes[1], pos12)) {
        Some(Ok(())) => {
            manifold.clear();
            return true;
        }
        Some(Err(corners)) => corners,
        None => Vec::new(),
    };
    let last = manifold
        .local_n1
        .try_normalize()
        .or(pos12.translation.try_normalize())
        .unwrap_or(Vector::X);
    let solids = SolidPair::new(pos12, one, other);
    let found = solids.separation_near(from_vector(last), f64::from(prediction), &mut corners);
    if let Some((known, around)) = memory {
        let gap = match &found {
            SeparationOutcome::Nothing => 0.0,
            SeparationOutcome::Far(_) => prediction,
            SeparationOutcome::Near(found) => to_real(found.distance_m),
        };
        known.note(around, pos12, gap, corners);
    }
    match found {
        SeparationOutcome::Nothing => return false,
        SeparationOutcome::Far(normal) => {
            manifold.clear();
            // The next search begins with it.
            manifold.local_n1 = to_vector(&normal);
        }
        SeparationOutcome::Near(Separation {
            distance_m,
            normal,
            points,
        }) => {
            let known = manifold.points.clone();
            manifold.clear();
            let [point, there] = points.map(|point| to_vector(&point));
            let (normal, back) = (
                to_vector(&normal),
                pos12.rotation.inverse() * -to_vector(&normal),
            );
            let there = pos12.inverse_transform_point(there);
            let (mut feature, mut facing) =
                (PolygonalFeature::default(), PolygonalFeature::default());
            first.local_support_feature_toward(normal, point, &mut feature);
            second.local_support_feature_toward(back, there, &mut facing);
            PolygonalFeature::contacts(
                pos12,
                &pos12.inverse(),
                normal,
                back,
                &feature,
                &facing,
                manifold,
                false,
            );
            let unknown = PackedFeatureId::UNKNOWN;
            manifold.points.push(TrackedContact::new(
                point,
                there,
                unknown,
                unknown,
                to_real(distance_m),
            ));
            (manifold.local_n1, manifold.local_n2) = (normal, back);
            manifold.match_contacts(&known);
        }
    }
    true
}

/// Returns the memory of the first shape that has one, and the other shape.
fn memory_of([one, other]: [&dyn Shape; 2]) -> Option<(&Neighbours, &dyn Shape)> {
    memory(one)
        .map(|known| (known, other))
        .or_else(|| memory(other).map(|known| (known, one)))
}

fn memory(shape: &dyn Shape) -> Option<&Neighbours> {
    shape.as_shape::<Hull>()?.neighbours.as_ref()
}

#[cfg(test)]
mod tests {
    /// A stave of a glass over the upper edge of a bottle, as in a simulation: they touched along
    /// `last` a step before.
    #[test]
    fn bodies_that_touch_at_an_edge_are_not_deep_in_each_other() {
        use super::*;
        use parry3d::shape::{Cuboid, Cylinder};
        use rapier3d::prelude::Rotation;

        let pos12 = Pose {
            rotation: Rotation::from_xyzw(-0.156_316_7, -0.921_394_35, -0.288_845_5, -0.207_764_55),
            translation: Vector::new(0.020_994_356, -0.042_384_822, 0.074_235_68),
            ..Pose::default()
        };
        let (stave, bottle) = (
            Cuboid::new(Vector::new(0.002, 0.010_870_4, 0.073_027_395)),
            Cylinder::new(0.02, 0.03),
        );
        let last = Vector::new(0.773_030_46, -0.611_933_65, 0.167_215_65);
        let mut known = ContactManifold::default();
        (known.local_n1, known.local_n2) = (last, pos12.rotation.inverse() * -last);
        let deepest = |manifolds: &[ContactManifold<ContactManifoldData, ContactData>]| {
            let points = manifolds.iter().flat_map(|manifold| &manifold.points);
            points.map(|point| -point.dist).fold(0.0, Real::max)
        };
        let mut by_library = vec![known.clone()];
        let found = DefaultQueryDispatcher.contact_manifolds(
            &pos12,
            &stave,
            &bottle,
            0.02,
            &mut by_library,
            &mut None,
        );
        assert!(
            found.is_ok() && deepest(&by_library) > 0.04,
            "the library is right by now: {}",
            deepest(&by_library)
        );
        let mut mended = vec![known];
        let found = RecomputeContacts.contact_manifolds(
            &pos12,
            &stave,
            &bottle,
            0.02,
            &mut mended,
            &mut None,
        );
        assert!(
            found.is_ok() && deepest(&mended) < 1e-3,
            "{} m deep",
            deepest(&mended)
        );
    }

    /// A can moves slowly around a piece of a finger, in and out of contact. The hull that
    /// remembers finds the same nearest contact as one that does not, whenever it is near enough to
    /// be solved, and searches less often.
    #[test]
    fn a_hull_with_a_memory_finds_the_same_contacts() {
        use super::*;
        use actcheck_data::Choices;
        use parry3d::shape::Cylinder;
        use rapier3d::prelude::Rotation;

        use actcheck_geometry::SURE_M;

        let mut choices = Choices::random(21, 0);
        let mut number = |most: f64| to_real(choices.real("at".into(), -most, most, 0.0));
        let (mut near, mut skipped) = (0, 0);
        for _ in 0..20 {
            let corners: Vec<Vector> = (0..24)
                .map(|_| Vector::new(number(0.01), number(0.02), number(0.008)))
                .collect();
            let plain = Hull::of(&corners).expect("the corners are not in a plane");
            let (known, can) = (plain.with_memory(), Cylinder::new(0.06, 0.033));
            let (mut by_plain, mut by_known) = (Vec::new(), Vec::new());
            let (from, turn) = (
                Vector::new(0.06, number(0.02), number(0.02)),
                Vector::new(number(1.0), 0.0, number(1.0)),
            );
            for step in 0..400_u16 {
                let share = Real::from(step) / 400.0;
                let way = Vector::new(
                    0.035 * (share * std::f32::consts::PI).sin(),
                    0.01 * share,
                    0.0,
                );
                let pos12 = Pose::from_parts(
                    from - way,
                    Rotation::from_scaled_axis(turn * (1.0 + 0.1 * share)),
                );
                assert!(between_solids(&pos12, [&plain, &can], 0.006, &mut by_plain));
                assert!(between_solids(&pos12, [&known, &can], 0.006, &mut by_known));
                let nearest =
                    |manifolds: &[ContactManifold<ContactManifoldData, ContactData>]| {
                        let points = manifolds.iter().flat_map(|manifold| &manifold.points);
                        points
                            .map(|point| point.dist)
                            .fold(Real::INFINITY, Real::min)
                    };
                let (one, other) = (nearest(&by_plain), nearest(&by_known));
                if one < SURE_M {
                    near += 1;
                    assert!(
                        (one - other).abs() < 5e-6,
                        "{one} m and {other} m in step {step}"
                    );
                    assert!(
                        by_plain[0].local_n1.dot(by_known[0].local_n1) > 0.999,
                        "step {step}"
                    );
                } else if one.is_finite() && !other.is_finite() {
                    skipped += 1;
                }
            }
        }
        assert!(
            near > 1000 && skipped > 200,
            "{near} near, {skipped} skipped"
        );
    }
}
