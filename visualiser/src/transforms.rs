//! The frames of modules and spots (REP-105: children of the frame of all poses).

use formation_model::{ModuleSize, Target};
use formation_msgs::Header;
use formation_msgs::external::geometry_msgs::{Transform, TransformStamped};
use formation_msgs::external::tf2_msgs::TFMessage;

use crate::scene::DrawnScene;

/// Where each live module stands: `module_N`.
pub(crate) fn of_modules(scene: &DrawnScene, header: &Header, size: ModuleSize) -> TFMessage {
    let live = scene.figures().filter(|(_, figure)| figure.is_live);
    TFMessage {
        transforms: live
            .map(|(module, figure)| TransformStamped {
                header: header.clone(),
                child_frame_id: format!("module_{}", module.0),
                transform: Transform::new(&figure.snapshot.pose, size),
            })
            .collect(),
    }
}

/// Where each spot lies: `spot_N`.
pub(crate) fn of_spots(target: &Target, header: &Header, size: ModuleSize) -> TFMessage {
    TFMessage {
        transforms: target
            .spots()
            .iter()
            .map(|spot| TransformStamped {
                header: header.clone(),
                child_frame_id: format!("spot_{}", spot.id.0),
                transform: Transform::new(&spot.pose, size),
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::scene::tests::scene;

    #[test]
    fn live_modules_and_all_spots_have_frames() {
        let mut scene = scene();
        let size = ModuleSize::from_metres(0.08).unwrap();
        let names = |sample: TFMessage| -> Vec<String> {
            let transforms = sample.transforms.into_iter();
            transforms
                .map(|transform| transform.child_frame_id)
                .collect()
        };
        assert_eq!(
            names(of_modules(&scene, &Header::default(), size)),
            ["module_2", "module_3"]
        );
        let spots = of_spots(scene.target().unwrap(), &Header::default(), size);
        assert!((spots.transforms[1].transform.translation.x - 0.48).abs() < 1e-9);
        assert_eq!(names(spots), ["spot_1", "spot_2"]);
        scene.advance(Duration::from_secs(60));
        assert_eq!(names(of_modules(&scene, &Header::default(), size)), [""; 0]);
    }
}
