//! Between numpy arrays and slices, without copies. All of this module's `unsafe` is about memory that one side owns and
//! the other one reads.

#![allow(unsafe_code, reason = "numpy and Rust read each other's memory in place")]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use numpy::ndarray::ArrayView2;
use numpy::{Element, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sbdp_client::{Part, Step, Vertices};

/// Rows of three numbers in an array that is kept alive.
struct Rows<T> {
    first: *const [T; 3],
    count: usize,
    _array: Py<PyArray2<T>>,
}

// SAFETY: The pointer is to the data of the array, whose reference this holds: it stays where it is, for numpy resizes no
// array that others refer to. It is read only. That nobody writes to the array meanwhile is what the documentation asks of
// callers; what a writer would cause is another mesh, which the daemon checks like all meshes.
unsafe impl<T: Send + Sync> Send for Rows<T> {}
// SAFETY: As above.
unsafe impl<T: Send + Sync> Sync for Rows<T> {}

impl<T: Element + bytemuck::Pod> Rows<T> {
    fn new(array: &Bound<'_, PyArray2<T>>, what: &str) -> PyResult<Self> {
        let readable: PyReadonlyArray2<'_, T> = array.try_readonly()?;
        let wrong = |why: &str| PyValueError::new_err(format!("{what}: {why}"));
        if readable.shape()[1] != 3 {
            return Err(wrong("an array of shape (n, 3) is wanted"));
        }
        let numbers = readable.as_slice().map_err(|_| wrong("the array is not contiguous in C order"))?;
        let rows: &[[T; 3]] =
            bytemuck::try_cast_slice(numbers).map_err(|_| wrong("the array is not aligned"))?;
        Ok(Self { first: rows.as_ptr(), count: rows.len(), _array: array.clone().unbind() })
    }
}

impl<T> Rows<T> {
    fn slice(&self) -> &[[T; 3]] {
        // SAFETY: See `Send`: the rows are there as long as `self` is.
        unsafe { std::slice::from_raw_parts(self.first, self.count) }
    }
}

enum VertexRows {
    F64(Rows<f64>),
    F32(Rows<f32>),
}

/// The mesh of a part in two arrays, which are read where they are.
pub(crate) struct ArrayMesh {
    vertices: VertexRows,
    triangles: Rows<u32>,
}

impl ArrayMesh {
    /// Arrays of shape (n, 3), float64 or float32, and (m, 3), uint32; contiguous and aligned.
    pub(crate) fn new(
        name: &str,
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let what = |which: &str| format!("{which} of part `{name}`");
        let vertices = if let Ok(wide) = vertices.cast::<PyArray2<f64>>() {
            VertexRows::F64(Rows::new(wide, &what("vertices"))?)
        } else if let Ok(narrow) = vertices.cast::<PyArray2<f32>>() {
            VertexRows::F32(Rows::new(narrow, &what("vertices"))?)
        } else {
            let wanted = "an array of float64 or float32 of shape (n, 3) is wanted";
            return Err(PyValueError::new_err(format!("{}: {wanted}", what("vertices"))));
        };
        let Ok(numbers) = triangles.cast::<PyArray2<u32>>() else {
            let wanted = "an array of uint32 of shape (m, 3) is wanted";
            return Err(PyValueError::new_err(format!("{}: {wanted}", what("triangles"))));
        };
        Ok(Self { vertices, triangles: Rows::new(numbers, &what("triangles"))? })
    }

    pub(crate) fn part<'a>(&'a self, name: &'a str) -> Part<'a> {
        let vertices = match &self.vertices {
            VertexRows::F64(rows) => Vertices::F64(rows.slice()),
            VertexRows::F32(rows) => Vertices::F32(rows.slice()),
        };
        Part { name, vertices, triangles: self.triangles.slice() }
    }
}

/// What a view of a path refers to: it keeps the memory, and is counted.
#[pyclass(frozen, module = "sbdp", name = "_Held")]
pub(crate) struct Held {
    step: Step,
    counted: Arc<AtomicUsize>,
}

impl Drop for Held {
    fn drop(&mut self) {
        self.counted.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The path of a step as an array of shape (n, 7) that is read where it came, and cannot be written to.
pub(crate) fn path_view<'py>(
    py: Python<'py>,
    step: &Step,
    counted: &Arc<AtomicUsize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    counted.fetch_add(1, Ordering::Relaxed);
    let held = Bound::new(py, Held { step: step.clone(), counted: Arc::clone(counted) })?;
    let path = held.get().step.view().path;
    let numbers: &[f64] = bytemuck::cast_slice(path);
    let view = ArrayView2::from_shape((path.len(), 7), numbers);
    let view = view.map_err(|error| PyValueError::new_err(error.to_string()))?;
    // SAFETY: The memory belongs to the step, a clone of which is in the container: it stays as long as the array. Nothing
    // writes to it: it is marked as not writeable at once, and numpy lets nobody change that, as the container is no
    // buffer.
    let array = unsafe { PyArray2::borrow_from_array(&view, held.clone().into_any()) };
    drop(array.readwrite().make_nonwriteable());
    Ok(array)
}

/// The path of a step as an array of its own.
pub(crate) fn path_copy<'py>(py: Python<'py>, step: &Step) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let path = step.view().path;
    numpy::PyArray1::from_slice(py, bytemuck::cast_slice::<_, f64>(path)).reshape([path.len(), 7])
}

/// Rows of numbers as an array of its own.
pub(crate) fn rows_copy<'py, T: Element + bytemuck::Pod>(
    py: Python<'py>,
    rows: &[[T; 3]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    numpy::PyArray1::from_slice(py, bytemuck::cast_slice::<_, T>(rows)).reshape([rows.len(), 3])
}
