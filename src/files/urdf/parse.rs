//! XML of a robot description.

use std::f64::consts::PI;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use super::{OriginPlace, RobotModel, UrdfError, UrdfJoint, UrdfJointType, UrdfMimic};
use crate::geometry::RigidTransform;
use crate::text::Named as _;

/// Largest number of XML nodes.
const MAX_NODES: u32 = 1_000_000;
/// Largest coordinate in metres and angle in radians.
const MAX_NUMBER: f64 = 1e6;

impl RobotModel {
    /// Parses a text; `source` is named in errors.
    ///
    /// # Errors
    /// When it is no URDF, or contains macros of xacro.
    pub fn parse(text: String, source: &Path) -> Result<Self, UrdfError> {
        let syntax = |problem: String| UrdfError::Syntax { problem, path: source.to_owned() };
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(&text, options).map_err(|error| syntax(error.to_string()))?;
        let root = document.root_element();
        if let Some(found) = xacro_in(&document) {
            return Err(UrdfError::Xacro { found, path: source.to_owned() });
        }
        if root.tag_name().name() != "robot" {
            return Err(syntax(format!("the root element is <{}>, expected <robot>", root.tag_name().name())));
        }
        let elements = |name: &'static str| root.children().filter(move |node| node.has_tag_name(name));
        let named = |node: Node<'_, '_>| node.attribute("name").map(str::to_owned);
        let links: Vec<String> = elements("link").filter_map(named).collect();
        let mut joints: Vec<UrdfJoint> = Vec::new();
        // Joints of `transmission` and `ros2_control` elements are no children of the root.
        for node in elements("joint") {
            let joint = read_joint(node, source)?;
            let problem = |problem: String| joint_error(&joint.name, problem, source);
            if joints.iter().any(|other| other.name == joint.name) {
                return Err(problem("is described twice".to_owned()));
            }
            if let Some(other) = joints.iter().find(|other| other.child == joint.child) {
                return Err(problem(format!("link '{}' is already the child of '{}'", joint.child, other.name)));
            }
            for link in [&joint.parent, &joint.child] {
                if !links.contains(link) {
                    return Err(problem(format!("link '{link}' is not described")));
                }
            }
            joints.push(joint);
        }
        let name = named(root).unwrap_or_else(|| "robot".to_owned());
        drop(document);
        Ok(Self { name, links, joints, source: source.to_owned(), text })
    }
}

/// First macro of xacro in a document; the declaration of its namespace alone is none.
fn xacro_in(document: &Document<'_>) -> Option<String> {
    document.descendants().filter(Node::is_element).find_map(|node| {
        let is_macro = node.tag_name().namespace().is_some_and(|namespace| namespace.contains("xacro"));
        if is_macro {
            return Some(format!("<xacro:{}>", node.tag_name().name()));
        }
        let substituted = node.attributes().find(|it| it.value().contains("${") || it.value().contains("$("));
        substituted.map(|it| format!("{}=\"{}\"", it.name(), it.value()))
    })
}

fn joint_error(joint: &str, problem: impl Into<String>, source: &Path) -> UrdfError {
    UrdfError::Joint { joint: joint.to_owned(), problem: problem.into(), path: source.to_owned() }
}

fn read_joint(node: Node<'_, '_>, source: &Path) -> Result<UrdfJoint, UrdfError> {
    let name = node.attribute("name").unwrap_or_default().to_owned();
    let problem = |problem: String| joint_error(&name, problem, source);
    let child_of = |tag: &str| node.children().find(|child| child.has_tag_name(tag));
    let link = |tag: &str| {
        let link = child_of(tag).and_then(|child| child.attribute("link"));
        link.map(str::to_owned).ok_or_else(|| problem(format!("<{tag} link=…> is missing")))
    };
    let type_name = node.attribute("type").unwrap_or_default();
    let joint_type = UrdfJointType::from_name(type_name)
        .ok_or_else(|| problem(format!("type '{type_name}', expected {}", UrdfJointType::alternatives())))?;
    let origin_node = child_of("origin");
    let vector = |node: Option<Node<'_, '_>>, attribute: &str, default: [f64; 3]| {
        let Some(text) = node.and_then(|node| node.attribute(attribute)) else { return Ok(Vector3::from(default)) };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(number).collect();
        let numbers = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        numbers.map(Vector3::from).ok_or_else(|| problem(format!("{attribute}=\"{text}\", expected three numbers")))
    };
    let xyz_m = vector(origin_node, "xyz", [0.0; 3])?;
    let rpy_rad = vector(origin_node, "rpy", [0.0; 3])?;
    let axis = vector(child_of("axis"), "xyz", [1.0, 0.0, 0.0])?;
    let axis = axis.try_normalize(1e-9).ok_or_else(|| problem("its axis is zero".to_owned()))?;
    let scalar = |node: Node<'_, '_>, attribute: &str, default: f64| {
        let Some(text) = node.attribute(attribute) else { return Ok(default) };
        number(text).ok_or_else(|| problem(format!("{attribute}=\"{text}\", expected a number")))
    };
    let limits_rad = match child_of("limit") {
        Some(limit) if joint_type == UrdfJointType::Revolute => {
            let limits = (scalar(limit, "lower", 0.0)?, scalar(limit, "upper", 0.0)?);
            if limits.0 > limits.1 {
                return Err(problem(format!("its lower limit {} is above its upper limit {}", limits.0, limits.1)));
            }
            limits
        }
        _ => (-PI, PI),
    };
    let mimic = match child_of("mimic") {
        Some(mimic) => Some(UrdfMimic {
            joint: mimic.attribute("joint").unwrap_or_default().to_owned(),
            multiplier: scalar(mimic, "multiplier", 1.0)?,
            offset_rad: scalar(mimic, "offset", 0.0)?,
        }),
        None => None,
    };
    let rotation = UnitQuaternion::from_euler_angles(rpy_rad.x, rpy_rad.y, rpy_rad.z);
    let (parent, child) = (link("parent")?, link("child")?);
    let place = match origin_node {
        Some(origin) => {
            let range = |attribute: &str| origin.attribute_node(attribute).map(|node| node.range_value());
            OriginPlace::Attributes { xyz: range("xyz"), rpy: range("rpy"), end: end_of_name(origin) }
        }
        None => OriginPlace::Missing(end_of_start_tag(node)),
    };
    Ok(UrdfJoint {
        joint_type,
        parent,
        child,
        origin: RigidTransform::new(rotation, xyz_m),
        axis,
        limits_rad,
        mimic,
        place,
        name,
    })
}

/// Place behind the name of an element, in bytes of the document.
fn end_of_name(node: Node<'_, '_>) -> usize {
    let start = node.range().start + 1;
    let text = &node.document().input_text()[start..];
    start + text.find(|letter: char| letter.is_whitespace() || letter == '/' || letter == '>').unwrap_or(0)
}

/// Place of the first child of an element, in bytes of the document.
fn end_of_start_tag(node: Node<'_, '_>) -> usize {
    // A joint has children: its links.
    node.first_child().map_or_else(|| node.range().end, |child| child.range().start)
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|value| value.abs() <= MAX_NUMBER)
}
