// cpp_client BOWLS [CANCEL_AFTER]: sends the goal, prints each feedback, the outcome and the bowls of the result;
// cancels the goal once that many bowls have come.
#include <actionlib/client/simple_action_client.h>
#include <actions_tutorial/WashTheDishesAction.h>
#include <ros/ros.h>

#include <cstdlib>
#include <iostream>

using Client = actionlib::SimpleActionClient<actions_tutorial::WashTheDishesAction>;

int main(int argc, char** argv)
{
  ros::init(argc, argv, "cpp_client");
  actions_tutorial::WashTheDishesGoal goal;
  goal.number_of_minutes = std::atoi(argv[1]);
  int cancel_after = argc > 2 ? std::atoi(argv[2]) : -1;

  Client client("wash_dishes_as", true);  // true: a thread of its own calls back
  if (!client.waitForServer(ros::Duration(60)))
    return 1;
  ros::WallDuration(0.2).sleep();  // or the first feedback may get lost, as with actionlib's client in Python
  client.sendGoal(goal, Client::SimpleDoneCallback(), Client::SimpleActiveCallback(),
                  [&](const actions_tutorial::WashTheDishesFeedbackConstPtr& feedback)
                  {
                    std::cout << "feedback " << feedback->last_dish_washed << std::endl;
                    if (--cancel_after == 0)
                      client.cancelGoal();
                  });
  if (!client.waitForResult(ros::Duration(60)))
    return 1;
  std::cout << client.getState().toString();
  for (const std::string& dish : client.getResult()->dishes_washed)
    std::cout << " " << dish;
  std::cout << std::endl;
}
