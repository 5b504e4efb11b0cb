//! The hashes by which ROS 2 tells versions of a type apart (REP 2011). From Jazzy on, the user data of every reader
//! and writer holds that of its type, where `ros2 topic info --verbose` reads it.

/// Types of the topics and services of this node, with the hashes that rosidl computes from their definitions.
const HASHES: [(&str, &str); 25] = [
    ("diagnostic_msgs/msg/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
    ("long_term_tracker/msg/TrackArray", "5f11b3b5b6f87f8bc74fd41e75c4f0dd81c5164408a67a9ff9db4978b8e306ca"),
    ("rcl_interfaces/msg/Log", "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac"),
    ("rcl_interfaces/msg/ParameterEvent", "043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"),
    (
        "rcl_interfaces/srv/DescribeParameters_Request",
        "05dd1c2bc87dec2627105c8070d6f9725c781a4f2ab852975bf105462b82b644",
    ),
    (
        "rcl_interfaces/srv/DescribeParameters_Response",
        "ad6747319613c6131589e062e095b469a46cc764f7d0f12a001a49e6cd893995",
    ),
    (
        "rcl_interfaces/srv/GetParameterTypes_Request",
        "87d7ec5ef545d4daa289d500025d31fb2437bc8b8365ca367161c4dac4be33fd",
    ),
    (
        "rcl_interfaces/srv/GetParameterTypes_Response",
        "ac1335dce67c478e669434f6ac2fbff34fcd529580f272d3006785ba8b54e47f",
    ),
    ("rcl_interfaces/srv/GetParameters_Request", "135a9e1c3d7cebef792f6687d7ddf99949b21a0bd9a320d863a9110a3f5cf4d6"),
    ("rcl_interfaces/srv/GetParameters_Response", "9fa773b46e39cc5d02db6224d8fd520bb9caeeffc2b27c96c1e59431baba9f2a"),
    ("rcl_interfaces/srv/ListParameters_Request", "a1b0b5d6b967a5b8ac5bc8563c3ea678f349e312a6a4967227c5a96bc5ce38df"),
    ("rcl_interfaces/srv/ListParameters_Response", "31b937b82de3612426be79f231e386259f97e8dc843e3f2845288b4bfa296bdd"),
    (
        "rcl_interfaces/srv/SetParametersAtomically_Request",
        "db0bd950ed5ed867a0e90b225e44dea382d762c0762ff3e0ee842190042a59e5",
    ),
    (
        "rcl_interfaces/srv/SetParametersAtomically_Response",
        "31b1a38c5b0b9d893ee24da45f69638f4561c78461d82d52750f429b534502b8",
    ),
    ("rcl_interfaces/srv/SetParameters_Request", "130d46386b7e84ea9ecf60608a4d83cbe5e5cb7c6cc5b712b7a4e3a6c254e932"),
    ("rcl_interfaces/srv/SetParameters_Response", "7a0e8140a0b8d98308fa81a5403a766e610af29a239caf54b7553227906fc266"),
    ("rmw_dds_common/msg/ParticipantEntitiesInfo", "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"),
    ("rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
    ("sensor_msgs/msg/CompressedImage", "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"),
    ("sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
    ("sensor_msgs/msg/RegionOfInterest", "ad16bcba5f9131dcdba6fbded19f726f5440e3c513b4fb586dd3027eeed8abb1"),
    ("std_srvs/srv/Trigger_Request", "d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199"),
    ("std_srvs/srv/Trigger_Response", "2d946c21e2fc3f1e9ca6986a8191d85fcc70097a8bb7771a053564bc47009cdf"),
    ("vision_msgs/msg/Detection2D", "0d12b69df5c593b3455b7346fac8205437a7d4bcb09b9e0e0b2dde787ded38ea"),
    ("vision_msgs/msg/Detection2DArray", "214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968"),
];

/// The user data of a reader or writer whose type has this name in DDS; `None` where the hash is not known.
pub fn user_data(type_name: &str) -> Option<String> {
    let name = ros_name(type_name)?;
    let (_, hash) = HASHES.iter().find(|(known, _)| *known == name)?;
    Some(format!("typehash=RIHS01_{hash};"))
}

/// `std_srvs/srv/Trigger_Request` of `std_srvs::srv::dds_::Trigger_Request_`.
fn ros_name(dds: &str) -> Option<String> {
    Some(dds.strip_suffix('_')?.replacen("::dds_::", "/", 1).replacen("::", "/", 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_type_is_found_by_its_name_in_dds() {
        let request = user_data("std_srvs::srv::dds_::Trigger_Request_").unwrap();
        assert_eq!(request, "typehash=RIHS01_d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199;");
        assert!(user_data("sensor_msgs::msg::dds_::Image_").unwrap().starts_with("typehash=RIHS01_d31d41a9"));
        assert!(user_data("std_msgs::msg::dds_::String_").is_none(), "none of ours");
        assert!(user_data("DCPSParticipant").is_none());
    }
}
