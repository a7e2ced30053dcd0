//! The names of the inputs, from which the form, figures and reports take them.

use serde_json::Value;

/// An input of a scenario.
#[derive(Debug, Clone, Copy)]
pub struct Input {
    /// Its pointer, with `#` in place of the place in a list. After `?` is a sibling that the scenario must have.
    pub pointer: &'static str,
    /// The name for people, with `#` in place of the place in a list, counted from 1.
    pub words: &'static str,
    /// The symbol, with the letters of the equations between `$`; empty if it has none.
    pub symbol: &'static str,
}

/// All inputs. The first that applies counts.
pub const INPUTS: &[Input] = &[
    input("/profile/shape", "Shape", ""),
    input("/profile/geometry", "Geometry", ""),
    input("/profile/radius", "Radius", "$R$"),
    input("/profile/radii/0", "Radius, axis along the motion", ""),
    input("/profile/radii/1", "Radius, axis across the motion", ""),
    input("/profile/slope_angle", "Slope angle", "$θ$"),
    input("/profile/exponent", "Exponent", "$n$"),
    input("/profile/at_radius", "Reference radius", ""),
    input("/profile/height?at_radius", "Height at reference radius", ""),
    input("/profile/height", "Height", ""),
    input("/profile/flat_radius", "Flat radius", "$b$"),
    input("/profile/flat_half_width", "Half-width of the flat", "$b$"),
    input("/profile/edge_radius", "Edge radius", "$R$"),
    input("/profile/length", "Length of the contact", ""),
    input("/moduli/normal", "Normal modulus", "$E$*"),
    input("/moduli/tangential", "Tangential modulus", "$G$*"),
    input("/bodies/#/youngs_modulus", "Body #: Young's modulus", "$E$"),
    input("/bodies/#/poisson_ratio", "Body #: Poisson's ratio", "$ν$"),
    input("/bodies/#/yield_strength", "Body #: yield strength", ""),
    input("/friction", "Friction coefficient", "$μ$"),
    input("/friction/run_in/cycles", "Run-in cycles of μ", ""),
    input("/friction/run_in/from", "μ at the start", ""),
    input("/friction/run_in/to", "μ after the run-in", ""),
    input("/friction/over", "μ changes over", ""),
    input("/friction/at", "Points of the table of μ", ""),
    input("/friction/values", "Values of μ", ""),
    input("/wear/coefficient?hardness", "Archard coefficient", "$k$"),
    input("/wear/coefficient", "Wear coefficient", "$k_w$"),
    input("/wear/coefficient/run_in/cycles", "Run-in cycles of k_w", ""),
    input("/wear/coefficient/run_in/from", "k_w at the start", ""),
    input("/wear/coefficient/run_in/to", "k_w after the run-in", ""),
    input("/wear/coefficient/over", "k_w changes over", ""),
    input("/wear/coefficient/at", "Points of the table of k_w", ""),
    input("/wear/coefficient/values", "Values of k_w", ""),
    input("/wear/hardness", "Hardness", ""),
    input("/wear/energy_coefficient", "Energy coefficient", "$α$"),
    input("/wear/share", "Wear share of body 1", ""),
    input("/wear/bodies/#/coefficient?layers", "Body #, below the layers:", "$k_w$"),
    input("/wear/bodies/#/coefficient", "Body #:", "$k_w$"),
    input("/wear/bodies/#/layers/#/thickness", "Body #, layer #: thickness", ""),
    input("/wear/bodies/#/layers/#/coefficient", "Body #, layer #:", "$k_w$"),
    input("/load/normal_force", "Normal force", "$F$"),
    input("/load/indentation_depth", "Indentation depth", "$d$"),
    input("/load/held", "Load: kept constant", ""),
    input("/motion/amplitude?rig_stiffness", "Amplitude at the actuator", "$U$"),
    input("/motion/amplitude", "Amplitude", "$U$"),
    input("/motion/sliding_amplitude", "Sliding amplitude", ""),
    input("/motion/stick_ratio", "Stick ratio", "$c$/$a$₀"),
    input("/motion/tangential_force", "Tangential force", "$Q$"),
    input("/motion/reference_distance", "Reference distance", ""),
    input("/motion/rig_stiffness", "Rig stiffness", ""),
    input("/motion/loop_stiffness", "Loop stiffness", ""),
    input("/motion/held", "Motion: kept constant", ""),
    input("/motion/blocks", "Amplitude blocks", ""),
    input("/motion/blocks/#/amplitude", "Block #: amplitude", ""),
    input("/motion/blocks/#/sliding_amplitude", "Block #: sliding amplitude", ""),
    input("/motion/blocks/#/tangential_force", "Block #: tangential force", ""),
    input("/motion/blocks/#/stick_ratio", "Block #: stick ratio", ""),
    input("/motion/blocks/#/cycles", "Block #: cycles", ""),
    input("/motion/reversals", "Displacement record", ""),
    input("/cycles", "Output cycles", ""),
    input("/cycles/normalized", "Output cycles in N₀", ""),
    input("/cycles/dissipated_energy", "Dissipated energies of the outputs", ""),
    input("/profiles_at", "Cycles with profiles", ""),
    input("/until/wear_depth", "Stop at wear depth", ""),
    input("/model/method", "Method", ""),
    input("/model/xi", "Fitting parameter", "$ξ$"),
    input("/model/tolerance", "Tolerance", ""),
    input("/model/compare", "Compare with simplified rule", ""),
    input("/model/points", "Output radii", ""),
];

/// The names of values whose names are not their words.
pub const VALUES: &[(&str, &str)] = &[
    ("power", "Power law"),
    ("table", "Measured profile"),
    ("exact", "Exact method"),
    ("simplified", "Simplified rule"),
    ("log", "Logarithmic"),
];

const fn input(pointer: &'static str, words: &'static str, symbol: &'static str) -> Input {
    Input { pointer, words, symbol }
}

/// The name and the symbol of the input at a pointer of a scenario. Without a name, it is the last member in words.
#[must_use]
pub fn named(pointer: &str, scenario: &Value) -> (String, &'static str) {
    let parts: Vec<&str> = pointer.split('/').collect();
    let places: Vec<usize> = parts.iter().filter_map(|part| part.parse().ok()).collect();
    let applies = |input: &&Input| {
        let (own, sibling) = input.pointer.split_once('?').unwrap_or((input.pointer, ""));
        let is_place = |part: &str| part.parse::<usize>().is_ok();
        own.split('/').count() == parts.len()
            && own
                .split('/')
                .zip(&parts)
                .all(|(own, part)| own == *part || own == "#" && is_place(part))
            && (sibling.is_empty() || {
                let parent = pointer.rsplit_once('/').map_or("", |(parent, _)| parent);
                scenario.pointer(&format!("{parent}/{sibling}")).is_some()
            })
    };
    let Some(input) = INPUTS.iter().find(applies) else {
        return (parts[parts.len() - 1].replace('_', " "), "");
    };
    let mut words = input.words.to_owned();
    for place in places.iter().take(input.words.matches('#').count()) {
        words = words.replacen('#', &(place + 1).to_string(), 1);
    }
    (words, input.symbol)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn inputs_have_the_names_of_their_places() {
        let named = |pointer, scenario| named(pointer, &scenario);
        assert_eq!(named("/friction", json!({})), ("Friction coefficient".to_owned(), "$μ$"));
        assert_eq!(named("/bodies/1/youngs_modulus", json!({})).0, "Body 2: Young's modulus");
        let layer = "/wear/bodies/0/layers/2/thickness";
        assert_eq!(named(layer, json!({})).0, "Body 1, layer 3: thickness");
        assert_eq!(named("/profile/radii/1", json!({})).0, "Radius, axis across the motion");
        let archard = json!({"wear": {"coefficient": 1e-4, "hardness": "3 GPa"}});
        assert_eq!(named("/wear/coefficient", archard), ("Archard coefficient".to_owned(), "$k$"));
        assert_eq!(named("/wear/coefficient", json!({})).0, "Wear coefficient");
        let rig = json!({"motion": {"amplitude": 1e-6, "rig_stiffness": 2e7}});
        assert_eq!(named("/motion/amplitude", rig).0, "Amplitude at the actuator");
        assert_eq!(named("/motion/amplitude", json!({})).0, "Amplitude");
        assert_eq!(named("/motion/other_number", json!({})), ("other number".to_owned(), ""));
    }
}
