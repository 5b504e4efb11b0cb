//! The few protocol buffer messages that small ONNX networks need, with the field numbers of `onnx.proto`.

/// One field of a message, by its number.
#[derive(Clone, Default)]
pub struct Message(Vec<u8>);

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

    pub fn text(self, field: u64, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }

    pub fn message(self, field: u64, value: Message) -> Self {
        self.bytes(field, &value.0)
    }
}

const FLOAT: u64 = 1;
const INTEGERS: u64 = 7;

/// The file of a graph.
pub fn model(graph: Message) -> Vec<u8> {
    let opset = Message::default().text(1, "").number(2, 13);
    Message::default().number(1, 7).message(7, graph).message(8, opset).0
}

/// An attribute of integers.
pub fn integers(name: &str, values: &[usize]) -> Message {
    let attribute = Message::default().text(1, name);
    values.iter().fold(attribute, |a, &v| a.number(8, v as u64)).number(20, INTEGERS)
}

/// A tensor of weights or of a shape.
pub fn tensor(name: &str, dims: &[usize], kind: u64, raw: &[u8]) -> Message {
    let tensor = dims.iter().fold(Message::default(), |t, &d| t.number(1, d as u64));
    tensor.number(2, kind).text(8, name).bytes(9, raw)
}

pub fn weights(name: &str, dims: &[usize], values: &[f32]) -> Message {
    assert_eq!(dims.iter().product::<usize>(), values.len(), "{name}");
    tensor(name, dims, FLOAT, &values.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>())
}

/// The name and type of an input or output.
pub fn value(name: &str, shape: &[usize]) -> Message {
    let sides = shape.iter().enumerate().map(|(i, &side)| match side {
        0 => Message::default().text(2, &format!("{name}_{i}")),
        side => Message::default().number(1, side as u64),
    });
    let shape = sides.fold(Message::default(), |shape, side| shape.message(1, side));
    let tensor = Message::default().number(1, FLOAT).message(2, shape);
    Message::default().text(1, name).message(2, Message::default().message(1, tensor))
}
