//! Poses as the user writes them.

use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};

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

/// One of the six axes by name, or a vector that is not 0.
pub(super) fn direction(text: &str) -> Result<[f64; 3], String> {
    let (sign, axis) = match text.strip_prefix('-') {
        Some(axis) => (-1.0, axis),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    if let Some(axis) = ["x", "y", "z"].iter().position(|name| axis.eq_ignore_ascii_case(name)) {
        let mut direction = [0.0; 3];
        direction[axis] = sign;
        return Ok(direction);
    }
    let wrong = || "neither an axis, as +z, nor three numbers X,Y,Z of which one is not 0".to_owned();
    let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
    let direction: [f64; 3] = numbers.try_into().map_err(|_| wrong())?;
    let length = Vector3::from(direction).norm();
    if length.is_finite() && length > 0.0 { Ok(direction) } else { Err(wrong()) }
}

fn quaternion([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), f64::MIN_POSITIVE)
        .filter(|q| q.coords.iter().all(|c| c.is_finite()))
}

/// A finite number from 0 up.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if number.is_finite() && number >= 0.0 {
        Ok(number)
    } else {
        Err("not a finite number from 0 up".to_owned())
    }
}
