//! Prints the poses of the frame in the table beside the truth: `cargo run --release --example print_frame`. Printing
//! needs std, so this is an example: the crate itself builds for a board.

use groundpose::FixedWorkspace;
use groundpose_embedded::frame::{FRAME, TRUTH};
use groundpose_embedded::{estimate_frame, view};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The largest class has 28 keypoints.
    let mut workspace = FixedWorkspace::<28>::new();
    println!("vehicle  class      yaw       x       y       z  sigma z  inliers |  truth: yaw, x, y, z");
    estimate_frame(&view()?, &FRAME, &mut workspace, |index, result| {
        let class = FRAME[index].class.name;
        match result {
            Ok(pose) => {
                let ([x, y, z], sigma, n) = (pose.t, pose.depth_variance.sqrt(), pose.inliers);
                print!("{index:7}  {class:<6} {:7.3} {x:7.2} {y:7.2} {z:7.2} {sigma:8.2} {n:8} |", pose.yaw);
                let [yaw, x, y, z] = TRUTH[index];
                println!("{yaw:7.3} {x:7.2} {y:7.2} {z:7.2}");
            }
            Err(reason) => println!("{index:7}  {class:<6} {reason}"),
        }
    })?;
    Ok(())
}
