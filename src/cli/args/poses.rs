//! Poses as the user writes them.

use nalgebra::{Quaternion, Translation3, UnitQuaternion};

use crate::geometry::{Pose, Waypoint, waypoint_from_pose};

pub(super) fn moved(text: &str) -> Result<(String, Waypoint), String> {
    let wrong = || "not PART=X,Y,Z or PART=X,Y,Z,W,X,Y,Z with a quaternion that is not 0".to_owned();
    let (part, motion) = text.rsplit_once('=').ok_or_else(wrong)?;
    let numbers: Vec<f64> =
        motion.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
    Ok((part.to_owned(), placed(&numbers).ok_or_else(wrong)?))
}

/// A shift, or a shift and a quaternion that is not 0.
pub(crate) fn placed(numbers: &[f64]) -> Option<Waypoint> {
    let shift = numbers.get(..3).filter(|shift| shift.iter().all(|x| x.is_finite()))?;
    let turn = match &numbers[3..] {
        [] => UnitQuaternion::identity(),
        &[w, x, y, z] => quaternion([w, x, y, z])?,
        _ => return None,
    };
    let shift = Translation3::new(shift[0], shift[1], shift[2]);
    Some(waypoint_from_pose(&Pose::from_parts(shift, turn)))
}

pub(super) fn rotation(text: &str) -> Result<UnitQuaternion<f64>, String> {
    let wrong = || "not four numbers W,X,Y,Z of which one is not 0".to_owned();
    let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
    let numbers: [f64; 4] = numbers.try_into().map_err(|_| wrong())?;
    quaternion(numbers).ok_or_else(wrong)
}

fn quaternion([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), f64::MIN_POSITIVE)
        .filter(|q| q.coords.iter().all(|c| c.is_finite()))
}
