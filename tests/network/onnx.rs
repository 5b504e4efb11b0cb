//! Writes small ONNX networks: the few protocol buffer messages that a chain of convolutions needs, with the field
//! numbers of `onnx.proto`.

/// One field of a message, by its number.
#[derive(Clone, Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(mut self, field: u64, value: u64) -> Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        self.varint(field << 3 | 2);
        self.varint(value.len() as u64);
        self.0.extend_from_slice(value);
        self
    }

    fn text(self, field: u64, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }

    fn message(self, field: u64, value: Message) -> Self {
        self.bytes(field, &value.0)
    }
}

const FLOAT: u64 = 1;
const INTEGERS: u64 = 7;

/// A convolution of 3 x 3 with a border of 1.
pub struct Convolution {
    /// Name of its output.
    pub name: &'static str,
    pub stride: usize,
    /// `outputs x inputs x 3 x 3`.
    pub weights: Vec<f32>,
    pub outputs: usize,
    pub inputs: usize,
}

/// A network of convolutions, one after the other, whose outputs are those of all of them. `shape` is that of its
/// input, named `image`; a 0 is a side that is free.
pub fn network(shape: &[usize], convolutions: &[Convolution]) -> Vec<u8> {
    let mut graph = Message::default().text(2, "test");
    let mut present = "image";
    for convolution in convolutions {
        let weights = format!("{}.weights", convolution.name);
        let ints = |name: &str, values: &[usize]| {
            let attribute = Message::default().text(1, name);
            values.iter().fold(attribute, |a, &v| a.number(8, v as u64)).number(20, INTEGERS)
        };
        let node = Message::default()
            .text(1, present)
            .text(1, &weights)
            .text(2, convolution.name)
            .text(4, "Conv")
            .message(5, ints("kernel_shape", &[3, 3]))
            .message(5, ints("pads", &[1; 4]))
            .message(5, ints("strides", &[convolution.stride; 2]));
        let raw: Vec<u8> = convolution.weights.iter().flat_map(|w| w.to_le_bytes()).collect();
        let dims = [convolution.outputs, convolution.inputs, 3, 3];
        let tensor = dims.iter().fold(Message::default(), |t, &d| t.number(1, d as u64));
        let tensor = tensor.number(2, FLOAT).text(8, &weights).bytes(9, &raw);
        let output = value(convolution.name, &[1, convolution.outputs, 0, 0]);
        graph = graph.message(1, node).message(5, tensor).message(12, output);
        present = convolution.name;
    }
    let graph = graph.message(11, value("image", shape));
    let opset = Message::default().text(1, "").number(2, 13);
    Message::default().number(1, 7).message(7, graph).message(8, opset).0
}

/// The name and type of an input or output.
fn value(name: &str, shape: &[usize]) -> Message {
    let sides = shape.iter().enumerate().map(|(i, &side)| match side {
        0 => Message::default().text(2, &format!("{name}_{i}")),
        side => Message::default().number(1, side as u64),
    });
    let shape = sides.fold(Message::default(), |shape, side| shape.message(1, side));
    let tensor = Message::default().number(1, FLOAT).message(2, shape);
    Message::default().text(1, name).message(2, Message::default().message(1, tensor))
}
